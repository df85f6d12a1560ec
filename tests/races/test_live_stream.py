"""A live event on the stream: nothing of a run before its time, all of it in order, and little when nothing happens."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import timedelta

import pytest
from django.utils import timezone

from core.events import Event
from core.streams import can_follow, topics_of
from races.entries.services.entries import accept_invitation
from races.live.services import launch, pause_live, react, set_message, tick_live
from races.live.streaming.event_stream import LEAST_S, RECENT, EventFeed, source, welcome
from races.models import Visibility
from tests import live_shows
from tests.factories import a_racer, outcome
from tests.live_shows import a_live_race, a_show, begun, compute, slot_of
from tests.pages.test_live_walls import a_trace

pytestmark = pytest.mark.django_db
CHUNK = timedelta(milliseconds=500)
LOOKS_AGAIN = timedelta(seconds=LEAST_S + 0.01)


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def clock(monkeypatch, now):
    """The time of the site, which the test moves on."""
    told = [now]
    monkeypatch.setattr(timezone, "now", lambda: told[0])
    return told


@pytest.fixture
def event(now, alice, wakes, clock, monkeypatch):
    """Bob's run is launched, carl's is computed. Both have a trace of 26 s."""
    monkeypatch.setattr(live_shows, "outcome", lambda laps: replace(outcome(laps), trace_csv=a_trace()))
    event = begun(a_show(now, alice, ["bob", "carl"]), alice, now)
    for name in ("bob", "carl"):
        compute(slot_of(event, name), now, 13_457, 12_861)
    launch(event=event, by=alice, seen=None, now=now - timedelta(seconds=10), slot=slot_of(event, "bob"))
    return event


def chunks_in(said: list[dict]) -> list[int]:
    return [chunk["n"] for one in said if "poses" in one for chunk in one["poses"]["chunks"]]


def test_a_chunk_is_told_once_it_has_passed_and_not_a_moment_before(event, clock, now):
    feed = EventFeed(str(event.race_id))
    told: list[int] = []
    for tenths in range(0, 41):
        clock[0] = now + timedelta(milliseconds=100 * tenths)
        said, _pause = feed.next(moved=False)
        told += chunks_in(said)
        assert told == list(range(tenths // 5)), f"after {tenths / 10} s"


def test_it_rests_until_the_next_chunk_has_passed(event, clock, now):
    feed = EventFeed(str(event.race_id))
    feed.next(moved=True)
    for at_ms in (0, 130, 499):
        clock[0] = now + timedelta(seconds=3, milliseconds=at_ms)
        _said, pause = feed.next(moved=False)
        assert pause == pytest.approx((500 - at_ms) / 1000 + 0.01)


def test_nothing_told_names_what_is_to_come(event, clock, now):
    """Times of laps that are not over, when the run ends, ids of sealed runs."""
    clock[0] = now + timedelta(seconds=6)
    feed = EventFeed(str(event.race_id))
    written = json.dumps([feed.next(moved=True)[0], welcome(str(event.race_id))])
    slot = slot_of(event, "bob")
    for needle in ("13457", "12861", "26318", slot.evaluation.public_id, str(round(slot.ends_at.timestamp() * 1000))):
        assert needle not in written
    clock[0] = now + timedelta(seconds=14)
    assert "13457" in json.dumps(feed.next(moved=True)[0]), "the needle is found once it was played"


def test_the_end_of_a_run_is_told_with_its_last_chunks(event, clock, now):
    feed = EventFeed(str(event.race_id))
    told, over_at = [], None
    for half in range(44, 60):
        clock[0] = now + half * CHUNK
        tick_live(now=clock[0])
        said, _pause = feed.next(moved=False)
        told += chunks_in(said)
        over = any(one["poses"]["over"] for one in said if "poses" in one)
        over_at = over_at or (half if over else None)
    assert told == list(range(44 - RECENT, 53)), "to the end at 26.3 s"
    assert over_at is not None and 500 * over_at >= 26_318
    assert not any("poses" in one for one in feed.next(moved=True)[0])


def test_a_run_that_waits_for_its_reveal_says_that_there_is_nothing_more(event, clock, now):
    feed = EventFeed(str(event.race_id))
    for half in (60, 61, 62):
        clock[0] = now + half * CHUNK
        said = [one["poses"] for one in feed.next(moved=False)[0] if "poses" in one]
        assert [one["over"] for one in said] == [False] and (half == 60 or said[0]["chunks"] == [])
        assert not [one for one in feed.next(moved=False)[0] if "poses" in one], "once"


def test_who_comes_in_the_middle_gets_the_last_seconds_and_what_happened_before(event, clock, now):
    clock[0] = now + timedelta(seconds=20)
    poses = welcome(str(event.race_id))["poses"]
    assert [chunk["n"] for chunk in poses["chunks"]] == list(range(40 - RECENT, 40))
    before = poses["before"]
    assert before["n"] == 40 - RECENT and {lap for chunk in poses["chunks"] for lap in chunk["cars"][0]["lap"]} == {2}
    assert {"t": 13_457, "car": 0, "kind": "lap", "lap": 1, "ms": 13_457} in before["events"]
    # a source that begins then says nothing that was missed in between
    assert chunks_in(EventFeed(str(event.race_id)).next(moved=True)[0])[0] <= 40 - RECENT + 1


def test_a_state_is_told_when_it_changed_and_reactions_apart(event, clock, now, alice):
    feed = EventFeed(str(event.race_id))

    def told_now(moved: bool) -> list[dict]:
        clock[0] += LOOKS_AGAIN
        return [one for one in feed.next(moved)[0] if "poses" not in one]

    told = [name for one in feed.next(moved=True)[0] for name in one]
    assert told == ["reactions", "state"]
    assert told_now(moved=True) == []
    set_message(event=event, message="Hello", by=alice, seen=None, now=now)
    said, pause = feed.next(moved=True)
    assert said == [] and pause == pytest.approx(LEAST_S, abs=1e-3), "it has just looked"
    (said,) = told_now(moved=False)
    assert said["state"]["message"] == "Hello" and "order" not in said["state"]
    react(event=event, kind="clap", session="s", address="a", now=now)
    assert told_now(moved=True) == [{"reactions": {**feed._reactions, "clap": 1}}]
    pause_live(event=event, by=alice, seen=None, now=now)
    assert told_now(moved=False) == [], "it is looked at once a second"
    clock[0] += timedelta(seconds=1)
    assert any("state" in one for one in told_now(moved=False)), "and without being told that it moved"


def test_a_state_that_is_too_large_is_asked_for(event, monkeypatch):
    monkeypatch.setattr("races.live.streaming.event_stream.MOST_BYTES", 100)
    (_reactions, said) = EventFeed(str(event.race_id)).next(moved=True)[0]
    assert list(said["state"]) == ["look"]


def test_a_live_event_moves_its_topic_and_a_run_of_its_race_does_not(event, alice, now):
    moving = [one for one in Event.objects.all() if f"live:{event.race_id}" in topics_of([one])[one.pk]]
    assert moving and {one.kind.partition(".")[0] for one in moving} <= {"live", "race"}
    assert all(one.kind != "run.queued" for one in moving)


def test_who_may_see_the_race_follows_its_event(now, wakes, alice):
    race = a_live_race(now, alice, visibility=Visibility.INVITATION)
    member = a_racer("member")
    accept_invitation(token=race.invitation, racer=member, now=now)
    may = {alice: True, member: True, a_racer("staff", is_staff=True): True, a_racer("stranger"): False, None: False}
    assert {who: can_follow(who, f"live:{race.pk}") for who in may} == may


def test_no_event_and_nonsense_say_nothing(now, alice):
    race = a_live_race(now, alice)
    for key in (str(race.pk), "999999", "x", "9" * 40, ""):
        assert welcome(key) is None
        assert EventFeed(key).next(moved=True)[0] == []
    assert source(str(race.pk), None)  # type: ignore[arg-type]
