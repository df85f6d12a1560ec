"""Races of real cars: guests that bear an alias, sessions that overlap, laps before the race opens."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest

from paddock.errors import UserFault
from races.boards.exports import board_data
from races.entries.services.entries import enter_race
from races.timing.services import carry_over, take_file
from tests.factories import a_racer
from tests.races.timing import a_physical_race, a_session, timed

pytestmark = pytest.mark.django_db


@pytest.fixture
def organiser():
    return a_racer("organiser")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser, opens_at=now - timedelta(hours=2))


def refused(code, call, **arguments):
    with pytest.raises(UserFault) as caught:
        call(**arguments)
    problems = getattr(caught.value, "problems", None)
    assert [one.fault.code for one in problems] == [code] if problems else caught.value.code == code


@pytest.mark.parametrize("name", ["alice", "ALICE", " Alice "])
def test_a_guest_does_not_bear_the_alias_of_a_racer_of_the_race(race, now, organiser, name):
    enter_race(race=race, racer=a_racer("alice"), now=now)
    sent = a_session(now, 10_000, guest=(uuid.uuid4(), name))
    refused("guest_is_racer", carry_over, race=race, by=organiser, sent=sent, now=now)
    refused("guest_is_racer", take_file, race=race, by=organiser, text=f"guest,lap,time\n{name},1,12\n", now=now)


def test_boards_say_who_is_a_guest(race, now, organiser, client):
    carry_over(race=race, by=organiser, sent=a_session(now, 9_000, guest=(uuid.uuid4(), "bob")), now=now)
    timed(race, a_racer("bob"), organiser, now, 10_000)
    rows = board_data(race, now)["rows"]
    assert [(row["racer"], row["guest"]) for row in rows] == [("bob", True), ("bob", False)]
    found = client.get(f"/api/v1/races/{race.slug}/board/").json()["results"]
    assert [(row["racer"], row["guest"]) for row in found] == [("bob", True), ("bob", False)]
    csv = client.get(f"{race.get_absolute_url()}board.csv").content.decode().splitlines()
    assert csv[0].endswith(",guest")


@pytest.mark.parametrize("later_s", [-20, 0, 5, 29])
def test_sessions_of_one_racer_do_not_overlap(race, now, organiser, later_s):
    alice = a_racer("alice")
    start = now - timedelta(minutes=30)
    first = timed(race, alice, organiser, now, 10_000, 10_000, 10_000, started_at=start)
    at = start + timedelta(seconds=later_s)
    sent = a_session(now, 30_000, racer="alice", started_at=at)
    refused("sessions_overlap", carry_over, race=race, by=organiser, sent=sent, now=now)
    assert first.entry.timed_sessions.count() == 1
    line = f"racer,lap,time,started_at\nalice,1,30,{at.isoformat()}\n"
    refused("sessions_overlap", take_file, race=race, by=organiser, text=line, now=now)


def test_sessions_one_after_the_other_and_of_others_are_taken(race, now, organiser):
    alice, start = a_racer("alice"), now - timedelta(minutes=30)
    timed(race, alice, organiser, now, 10_000, started_at=start)
    timed(race, alice, organiser, now, 10_000, started_at=start + timedelta(seconds=10))
    timed(race, a_racer("bob"), organiser, now, 10_000, started_at=start)
    gone = a_session(now, 10_000, racer="alice", started_at=start, discarded=True)
    assert carry_over(race=race, by=organiser, sent=gone, now=now) is None


def test_a_session_that_still_runs_takes_its_whole_time(race, now, organiser):
    alice, start = a_racer("alice"), now - timedelta(seconds=race.session_s - 10)
    timed(race, alice, organiser, now, 10_000, started_at=start, ended=False)
    sent = a_session(now, racer="alice", started_at=now, ended=False)
    refused("sessions_overlap", carry_over, race=race, by=organiser, sent=sent, now=now)


def test_a_file_without_starts_may_have_several_sessions(race, now, organiser):
    enter_race(race=race, racer=a_racer("alice"), now=now)
    text = "racer,session,lap,time\nalice,1,1,12\nalice,2,1,11\n"
    assert take_file(race=race, by=organiser, text=text, now=now) == 2
    assert take_file(race=race, by=organiser, text=text, now=now) == 2


@pytest.mark.parametrize("ahead", [timedelta(minutes=-1), timedelta(0), timedelta(hours=2), timedelta(days=3)])
def test_before_the_race_opens_that_is_the_problem(now, organiser, ahead):
    early = a_physical_race(
        now, organiser=organiser, opens_at=now + timedelta(days=1), closes_at=now + timedelta(days=9)
    )
    enter_race(race=early, racer=a_racer("alice"), now=now)
    sent = a_session(now, 1, racer="alice", started_at=now + ahead)
    refused("race_not_open_yet", carry_over, race=early, by=organiser, sent=sent, now=now)
    refused("race_not_open_yet", take_file, race=early, by=organiser, text="racer,lap,time\nalice,1,12\n", now=now)
