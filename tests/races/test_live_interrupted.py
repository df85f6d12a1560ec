"""A run during which the site was away: it is shown again, from its start, and nothing of it is known before."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.cache import cache

from core.streams import life
from races.live.commentary import story_of
from races.live.selectors.events import console_rows
from races.live.services import choose_model, launch, pause_live, release_slot, tick_live
from races.live.streaming.event_stream import EventFeed
from races.models import LiveEvent, SlotState, Submission
from tests.factories import a_model, a_racer
from tests.live_shows import a_show, begun, compute, racer_of, slot_of

pytestmark = pytest.mark.django_db
SECOND = timedelta(seconds=1)


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture(autouse=True)
def no_streams():
    cache.delete(life.KEY)
    yield
    cache.delete(life.KEY)


def on_track(now, alice, *, auto, seconds=5):
    """An event whose first run (20 s) has been played for some seconds, and what time it is then."""
    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered", auto_run=auto), alice, now)
    compute(slot_of(event, "bob"), now, 10_000, 10_000)
    launch(event=event, by=alice, seen=None, now=now)
    for _ in range(10 + seconds):
        now += SECOND
        tick_live(now=now)
    assert slot_of(event, "bob").state == SlotState.RUNNING
    return event, now


@pytest.mark.parametrize("away_s", [8, 20, 3600])
def test_an_event_that_runs_by_itself_shows_the_run_again(alice, now, away_s):
    event, now = on_track(now, alice, auto=True)
    before = slot_of(event, "bob")
    now += timedelta(seconds=away_s)
    tick_live(now=now)
    slot = slot_of(event, "bob")
    assert (slot.state, slot.reason_code) == (SlotState.RUNNING, "live_interrupted")
    assert (slot.evaluation_id, slot.starts_at) == (before.evaluation_id, now + timedelta(seconds=10))
    assert slot.ends_at - slot.starts_at == before.ends_at - before.starts_at
    assert not Submission.objects.exists()
    while now < slot.ends_at + 2 * SECOND:
        now += 3 * SECOND
        tick_live(now=now)
    assert slot_of(event, "bob").state == SlotState.DONE
    assert Submission.objects.get().evaluation_id == before.evaluation_id


def test_by_hand_the_run_is_held_as_interrupted(alice, now):
    event, now = on_track(now, alice, auto=False)
    before = slot_of(event, "bob")
    now += timedelta(seconds=40)
    tick_live(now=now)
    slot = slot_of(event, "bob")
    assert (slot.state, slot.reason_code, slot.starts_at) == (SlotState.HELD, "live_interrupted", None)
    assert not Submission.objects.exists()
    row = next(row for row in console_rows(event, now) if row.slot.pk == slot.pk)
    assert (row.sealed, "release" in row.may) == ("sealed", True)
    release_slot(event=event, slot=slot, by=alice, seen=None, now=now)
    launch(event=event, by=alice, seen=None, now=now)
    slot = slot_of(event, "bob")
    assert (slot.state, slot.evaluation_id) == (SlotState.RUNNING, before.evaluation_id)


def test_a_paused_event_holds_the_run(alice, now):
    event, now = on_track(now, alice, auto=True)
    pause_live(event=event, by=alice, seen=None, now=now)
    tick_live(now=now + timedelta(seconds=40))
    assert slot_of(event, "bob").state == SlotState.HELD


def test_what_was_begun_is_not_driven_with_another_car(alice, now):
    event, now = on_track(now, alice, auto=False)
    before = slot_of(event, "bob").evaluation_id
    tick_live(now=now + timedelta(seconds=40))
    bob = racer_of(event, "bob").entry.racer
    choose_model(event=event, racer=bob, model=a_model(bob), now=now + timedelta(seconds=41))
    assert slot_of(event, "bob").evaluation_id == before


def test_an_outage_in_the_countdown_or_after_the_end_interrupts_nothing(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    compute(slot_of(event, "bob"), now, 20_000)
    launch(event=event, by=alice, seen=None, now=now)
    for seconds in (1, 12, 14, 18, 22, 26, 29, 45):
        tick_live(now=now + timedelta(seconds=seconds))
    assert slot_of(event, "bob").state == SlotState.DONE
    assert slot_of(event, "bob").interrupted_at is None


def test_a_short_pause_of_the_clock_interrupts_nothing(alice, now):
    event, now = on_track(now, alice, auto=True)
    tick_live(now=now + timedelta(seconds=5))
    assert slot_of(event, "bob").interrupted_at is None


@pytest.mark.parametrize(
    ("began_s", "at_s", "shown"), [(-100, 19, True), (-100, 1, False), (18, 19, False)], ids=["lives", "dead", "new"]
)
def test_a_stream_process_that_lived_has_shown_the_run(alice, now, began_s, at_s, shown):
    """Only the clock was away: spectators saw all of it."""
    event, now = on_track(now, alice, auto=False)
    sign = {"began": (now + began_s * SECOND).timestamp(), "at": (now + at_s * SECOND).timestamp()}
    cache.set(life.KEY, sign)
    tick_live(now=now + 20 * SECOND)
    assert slot_of(event, "bob").state == (SlotState.DONE if shown else SlotState.HELD)


def test_spectators_are_shown_the_run_from_its_start(alice, now, monkeypatch):
    event, now = on_track(now, alice, auto=True)
    feed = EventFeed(str(event.race_id))

    def told(at):
        monkeypatch.setattr("races.live.streaming.event_stream.timezone.now", lambda: at)
        return [one["poses"] for one in feed.next(False)[0] if "poses" in one and one["poses"]["chunks"]]

    assert told(now)[-1]["chunks"][-1]["n"] == 9
    now += timedelta(seconds=60)
    tick_live(now=now)
    assert told(now) == []
    assert told(now + timedelta(seconds=11))[0]["chunks"][0]["n"] == 0


def test_the_commentary_says_so(alice, now):
    event, now = on_track(now, alice, auto=False)
    tick_live(now=now + timedelta(seconds=40))
    event = LiveEvent.objects.get(pk=event.pk)
    assert any("the run of bob is shown again" in one.text for one in story_of(event, now + timedelta(seconds=41)))
