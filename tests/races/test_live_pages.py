"""Pages and operations of a live event: who sees and does what."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from races.entries.services.entries import enter_race
from races.live.services import launch
from races.models import LiveEvent, LiveSlot, LiveState, SlotState, Visibility
from tests.clients import logged_in
from tests.factories import a_model, a_racer
from tests.live_shows import a_live_race, a_show, begun, compute, racer_of, slot_of, slots

pytestmark = pytest.mark.django_db
PAGES = ("live_event", "live_state", "live_console", "live_plan")


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def now():
    return timezone.now()


def test_a_private_event_is_nowhere_for_a_stranger(alice, now):
    race = a_live_race(now, alice, visibility=Visibility.INVITATION)
    event = a_show_in(race, alice, now)
    for viewer in (a_racer("mallory"), None):
        client = logged_in(viewer)
        for name in PAGES:
            answer = client.get(reverse(name, args=[race.slug]))
            assert answer.status_code == 404 or "login" in answer.url, name
        for path in ("", "console/", "poses/?slot=1"):
            assert client.get(f"/api/v1/races/{race.slug}/live/{path}").status_code in (401, 403, 404)
    for viewer in (alice, a_racer("stella", is_staff=True)):
        assert logged_in(viewer).get(reverse("live_event", args=[race.slug])).status_code == 200
    assert event.race_id == race.pk


def a_show_in(race, alice, now):
    from races.live.services import plan_live

    return plan_live(race=race, by=alice, now=now, starts_at=now + timedelta(minutes=30))


def test_who_may_see_it_may_not_run_it(alice, now):
    event = a_show(now, alice, ["bob"])
    client = logged_in(racer_of(event, "bob").entry.racer)
    assert client.get(reverse("live_event", args=[event.race.slug])).status_code == 200
    assert client.get(reverse("live_console", args=[event.race.slug])).status_code == 404
    assert client.post(reverse("live_act", args=[event.race.slug]), {"action": "begin"}).status_code == 404
    event.refresh_from_db()
    assert event.state == LiveState.PLANNED


def test_an_organiser_plans_with_a_time_zone(alice, now):
    race = a_live_race(now, alice)
    sent = {
        "starts_at": f"{now + timedelta(days=2):%Y-%m-%d}T20:15",
        "time_zone": "Asia/Seoul",
        "rounds": "1",
        "attempt_ms": "60",
        "order": "as_entered",
        "gap_s": "5",
    }
    answer = logged_in(alice).post(reverse("live_plan", args=[race.slug]), sent)
    assert answer.status_code == 302, answer.content.decode()
    event = LiveEvent.objects.get(race=race)
    assert (event.starts_at.hour, event.starts_at.minute, event.attempt_ms) == (11, 15, 60_000)
    refused = logged_in(alice).post(reverse("live_plan", args=[race.slug]), sent | {"time_zone": "Mars/Base"})
    assert refused.status_code == 422


def test_a_racer_chooses_and_answers_the_roll_call(alice, now):
    event = a_show(now, alice, ["bob"])
    LiveEvent.objects.update(lobby_opens_at=now - timedelta(minutes=1))
    bob = racer_of(event, "bob").entry.racer
    other = a_model(bob)
    client = logged_in(bob)
    client.post(reverse("live_mine", args=[event.race.slug]), {"model": other.public_id})
    client.post(reverse("live_mine", args=[event.race.slug]), {"here": "1"})
    mine = racer_of(event, "bob")
    assert mine.model == other
    assert mine.here_at is not None
    page = client.get(reverse("live_event", args=[event.race.slug])).content.decode()
    assert "You are here." in page


def test_the_console_works_without_scripts(alice, now):
    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
    for name in ("bob", "carl"):
        compute(slot_of(event, name), now, 9_000)
    client, act = logged_in(alice), reverse("live_act", args=[event.race.slug])
    event.refresh_from_db()
    client.post(act, {"action": "down", "slot": slot_of(event, "bob").pk, "version": event.version})
    assert [slot.racer.entry.racer.alias for slot in slots(event)] == ["carl", "bob"]
    client.post(act, {"action": "launch", "version": event.version})  # seen before the move
    assert not any(slot.state == SlotState.RUNNING for slot in slots(event))
    event.refresh_from_db()
    page = client.get(reverse("live_console", args=[event.race.slug])).content.decode()
    assert re.findall(r'id="(launch-\d+)"', page)
    client.post(act, {"action": "launch", "version": event.version})
    assert slots(event)[0].state == SlotState.RUNNING
    client.post(act, {"action": "undo"})
    assert slots(event)[0].state == SlotState.WAITING
    assert client.post(act, {"action": "explode"}).status_code == 404


def test_a_program_runs_an_event(alice, now):
    race = a_live_race(now, alice)
    client = logged_in(alice)
    live = f"/api/v1/races/{race.slug}/live/"
    planned = client.post(live, {"starts_at": (now + timedelta(hours=1)).isoformat(), "rounds": 1}, "application/json")
    assert planned.status_code == 201, planned.content
    enter_race(race=race, racer=(bob := a_racer("bob")), now=now)
    mine = logged_in(bob).post(f"{live}mine/", {"model": a_model(bob).public_id, "here": True}, "application/json")
    assert mine.status_code == 200, mine.content
    version = mine.json()["version"]
    begin = client.post(f"{live}console/", {"action": "begin", "version": version}, "application/json")
    assert begin.json()["phase"] == "running"
    again = client.post(f"{live}console/", {"action": "begin", "version": version}, "application/json")
    assert "live_changed" in again.content.decode()
    console = client.get(f"{live}console/").json()
    assert [row["racer"] for row in console["order"]] == ["bob"]


def test_poses_come_once_they_have_passed(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    slot = slot_of(event, "bob")
    compute(slot, now, 9_000)
    launch(event=event, by=alice, seen=None, now=now - timedelta(seconds=13))
    address = reverse("live_poses", args=[event.race.slug])
    said = logged_in(None).get(address, {"slot": slot.pk}).json()
    assert 4 <= len(said["chunks"]) <= 12
    assert not said["over"]
    more = logged_in(None).get(address, {"slot": slot.pk, "after": said["chunks"][-1]["n"]}).json()["chunks"]
    assert all(chunk["n"] > said["chunks"][-1]["n"] for chunk in more)
    assert logged_in(None).get(address, {"slot": "x"}).status_code == 404


def test_a_console_looks_by_itself_while_a_run_is_computed(alice, now):
    """That one was is told to nobody, so no stream says it."""
    event = begun(a_show(now, alice, ["bob", "carl", "dora"], order="as_entered"), alice, now)

    def looks() -> bool:
        page = logged_in(alice).get(reverse("live_console", args=[event.race.slug])).content.decode()
        return "data-waits" in page

    assert looks()
    compute(slot_of(event, "bob"), now, 9_000)
    assert looks(), "the one after it"
    compute(slot_of(event, "carl"), now, 9_000)
    assert not looks()
    LiveSlot.objects.filter(pk=slot_of(event, "bob").pk).update(evaluation=None)
    assert looks(), "it is to be queued"
    LiveSlot.objects.filter(pk=slot_of(event, "bob").pk).update(reason_code="live_no_model")
    assert looks(), "dora is next but one now"
    event.refresh_from_db()
    launch(event=event, by=alice, seen=None, now=timezone.now(), slot=slot_of(event, "carl"))
    assert looks(), "it counts down"


def test_the_plan_reports_all_problems_at_once(alice, now):
    race = a_live_race(now, alice)
    sent = {"starts_at": "2020-01-01T20:15", "time_zone": "UTC", "rounds": "0", "attempt_ms": "60", "order": "x"}
    answer = logged_in(alice).post(reverse("live_plan", args=[race.slug]), sent | {"gap_s": "5"})
    assert answer.status_code == 422
    assert set(answer.context["form"].errors) == {"starts_at", "rounds", "order"}
