"""Racers who leave the race while its live event is in the lobby or under way, and those who are taken out of it."""

from __future__ import annotations

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.models import Evaluation
from races.entries.services.entries import enter_race, remove_entry, withdraw
from races.live.document import live_document
from races.live.selectors.events import live_racers, live_standings
from races.live.services import (
    add_late,
    call_slot,
    crown,
    end_live,
    hold_slot,
    launch,
    prepare_ahead,
    release_slot,
    run_again,
    tick_live,
)
from races.models import LiveSlot, SlotState, Submission
from tests.clients import logged_in
from tests.factories import a_racer
from tests.live_shows import a_show, begun, compute, racer_of, show, slot_of, slots
from tests.refusals import refused

pytestmark = pytest.mark.django_db
NAMES = ["bob", "carl", "dora"]


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def alice():
    return a_racer("alice")


def entry_of(event, alias):
    return racer_of(event, alias).entry


def names(event) -> list[str]:
    return [row.racer.entry.racer.alias for row in live_standings(event)]


def to_come(event) -> list[str]:
    return [slot.driver_names for slot in slots(event) if slot.state in ("waiting", "called", "held")]


def test_who_leaves_in_the_lobby_is_in_no_list(alice, now, wakes):
    event = a_show(now, alice, NAMES)
    withdraw(entry=entry_of(event, "bob"), now=now)
    assert [racer.entry.racer.alias for racer in live_racers(event)] == ["carl", "dora"]
    assert "bob" not in [racer["racer"] for racer in live_document(event, now)["racers"]]
    begun(event, alice, now)
    assert to_come(event) == ["carl", "dora"]


@pytest.mark.parametrize("how", ["withdraws", "is removed"])
def test_who_leaves_is_taken_out_of_the_running_order_at_once(
    alice, now, wakes, how, django_capture_on_commit_callbacks
):
    event = begun(a_show(now, alice, NAMES, order="as_entered", rounds=2), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    hold_slot(event=event, slot=slot_of(event, "bob", 2), by=alice, seen=None, now=now)
    sealed = slot_of(event, "bob").evaluation_id
    with django_capture_on_commit_callbacks(execute=True):
        if how == "withdraws":
            withdraw(entry=entry_of(event, "bob"), now=now)
        else:
            remove_entry(entry=entry_of(event, "bob"), by=alice, now=now)
    assert set(to_come(event)) == {"carl", "dora"}
    assert {(slot.state, slot.reason_code) for slot in slots(event) if slot.driver_names == "bob"} == {
        ("removed", "live_left")
    }
    assert not Evaluation.with_sealed.filter(pk=sealed).exists() or slot_of(event, "bob").evaluation_id is None
    page = logged_in(alice).get(reverse("live_console", args=[event.race.slug])).content.decode()
    assert "left the race" in page and f'id="release-{slot_of(event, "bob").pk}"' not in page


def test_who_has_left_is_neither_launched_nor_released_nor_driven_again(alice, now, wakes):
    """Between their leaving and the clock that takes them out, too."""
    event = begun(a_show(now, alice, NAMES, order="as_entered"), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    withdraw(entry=entry_of(event, "bob"), now=now)
    assert slot_of(event, "bob").state == SlotState.WAITING, "the commit is still to come"
    who = {"event": event, "by": alice, "seen": None, "now": now}
    refused("live_left", launch, slot=slot_of(event, "bob"), **who)
    tick_live(now=now)
    assert slot_of(event, "bob").state == SlotState.REMOVED
    refused("live_left", release_slot, slot=slot_of(event, "bob"), **who)
    refused("live_not_in", crown, entry=entry_of(event, "bob"), **who)
    call_slot(slot=slot_of(event, "carl"), **who)


def test_who_comes_back_is_added_late(alice, now, wakes):
    event = begun(a_show(now, alice, NAMES, order="as_entered"), alice, now)
    withdraw(entry=entry_of(event, "bob"), now=now)
    tick_live(now=now)
    enter_race(race=event.race, racer=entry_of(event, "bob").racer, now=now)
    add_late(event=event, entry=entry_of(event, "bob"), by=alice, seen=None, now=now)
    assert to_come(event) == ["carl", "dora", "bob"]


def test_who_is_taken_out_after_driving_leads_and_wins_nothing(alice, now, wakes):
    event = begun(a_show(now, alice, NAMES, order="as_entered"), alice, now)
    for name, time_ms in (("bob", 8_000), ("carl", 9_000), ("dora", 9_500)):
        prepare_ahead(event=event, now=now)
        compute(slot_of(event, name), now, time_ms)
        now = show(event, slot_of(event, name), alice, now)
    crown(event=event, entry=entry_of(event, "bob"), by=alice, seen=None, now=now)
    assert names(event) == NAMES and live_document(event, now)["leader"]["racer"] == "bob"
    remove_entry(entry=entry_of(event, "bob"), by=alice, now=now)
    event.refresh_from_db()
    refused("live_left", run_again, event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    told = live_document(event, now)
    assert names(event) == ["carl", "dora"] and told["standings"][0]["gap_ms"] == 0
    assert (told["leader"]["racer"], told["winner"]) == ("carl", None)
    assert told["best_sectors"][0] == 9_000 // 3
    end_live(event=event, by=alice, seen=None, now=now)
    assert live_document(event, now)["podium"] == ["carl", "dora"]


def test_a_run_under_way_of_who_leaves_is_played_to_its_end(alice, now, wakes):
    """Everybody sees it; it counts for nothing."""
    event = begun(a_show(now, alice, NAMES, order="as_entered"), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    launch(event=event, by=alice, seen=None, now=now)
    withdraw(entry=entry_of(event, "bob"), now=now)
    slot = slot_of(event, "bob")
    tick_live(now=slot.ends_at + (slot.ends_at - slot.starts_at))
    assert LiveSlot.objects.get(pk=slot.pk).state == SlotState.DONE
    assert Submission.objects.filter(entry=entry_of(event, "bob")).count() == 1
    assert names(event) == ["carl", "dora"]
