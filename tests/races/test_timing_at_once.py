"""Several devices, tabs and people at the same moment at one race of real cars: on SQLite here, on PostgreSQL below."""

from __future__ import annotations

import uuid
from dataclasses import replace

import pytest

from accounts.models import Racer
from races.entries.services.entries import enter_race
from races.models import Crossing, Entry, Guest, MeasuredLap, TimedSession
from races.timing.services import carry_over, claim_guest, correct_lap, link_guest, make_sensor, take_crossing
from tests.factories import a_racer
from tests.races.test_concurrency import at_once
from tests.races.timing import a_physical_race, a_session, standing, timed

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser)


def test_two_devices_time_two_racers_and_one_session_that_both_send_counts_once(race, organiser, now):
    alice, bob = a_racer("alice"), a_racer("bob")
    for racer in (alice, bob):
        enter_race(race=race, racer=racer, now=now)
    both = a_session(now, 10_000, 9_500, racer="alice")
    sent = [both, both, both, a_session(now, 11_000, racer="bob"), a_session(now, 9_000, racer="alice")]
    answers = at_once([lambda one=one: carry_over(race=race, by=organiser, sent=one, now=now) for one in sent])
    assert all(isinstance(one, TimedSession) for one in answers), answers
    assert (standing(race, alice)[1], standing(race, bob)[1]) == (9_000, 11_000)
    entries = Entry.objects.order_by("racer__alias").values_list("submission_count", "last_number")
    assert list(entries) == [(2, 2), (1, 1)] and MeasuredLap.objects.count() == 4
    race.refresh_from_db()
    assert race.fastest_lap_ms == 9_000


def test_of_two_states_of_a_session_the_newer_stands_whichever_comes_first(race, organiser, now):
    alice = a_racer("alice")
    enter_race(race=race, racer=alice, now=now)
    old = a_session(now, 10_000, racer="alice", ended=False)
    new = replace(a_session(now, 10_000, 9_000, racer="alice"), id=old.id, revision=2)
    answers = at_once(
        [lambda one=one: carry_over(race=race, by=organiser, sent=one, now=now) for one in (old, new) * 2]
    )
    assert all(isinstance(one, TimedSession) for one in answers), answers
    session = TimedSession.objects.get()
    assert (session.revision, session.laps.count(), standing(race, alice)[1]) == (2, 2, 9_000)


def test_a_guest_whom_two_devices_bring_at_once_is_one_guest(race, organiser, now):
    id = uuid.uuid4()
    sent = [a_session(now, 10_000 - 100 * number, guest=(id, "Mia")) for number in range(3)]
    answers = at_once([lambda one=one: carry_over(race=race, by=organiser, sent=one, now=now) for one in sent])
    assert all(isinstance(one, TimedSession) for one in answers), answers
    assert Guest.objects.count() == Entry.objects.count() == 1
    assert (TimedSession.objects.count(), Entry.objects.get().score_ms) == (3, 9_800)


def test_new_guests_and_racers_of_several_devices_do_not_wait_for_each_other(race, organiser, now):
    alice = a_racer("alice")
    enter_race(race=race, racer=alice, now=now)
    for _ in range(3):
        guests = [a_session(now, 10_000, guest=(uuid.uuid4(), "Mia")) for _ in range(3)]
        sent = [*guests, *(a_session(now, 9_000, racer="alice") for _ in range(3))]
        answers = at_once([lambda one=one: carry_over(race=race, by=organiser, sent=one, now=now) for one in sent])
        assert all(isinstance(one, TimedSession) for one in answers), answers
    assert Guest.objects.count() == 9 and TimedSession.objects.count() == 18


def test_of_two_who_claim_the_same_laps_one_has_them_whatever_is_timed_meanwhile(race, organiser, now):
    id = uuid.uuid4()
    carry_over(race=race, by=organiser, sent=a_session(now, 10_000, guest=(id, "Mia")), now=now)
    guest, alice, bob = Guest.objects.get(), a_racer("alice"), a_racer("bob")
    answers = at_once(
        [
            lambda: claim_guest(claim=guest.claim, racer=alice, now=now),
            lambda: link_guest(guest=Guest.objects.get(pk=id), racer=bob, by=organiser, now=now),
            lambda: carry_over(race=race, by=organiser, sent=a_session(now, 9_000, guest=(id, "Mia")), now=now),
        ]
    )
    assert sorted(str(one) for one in answers[:2] if not isinstance(one, Entry)) == ["guest_linked"], answers
    assert isinstance(answers[2], TimedSession), answers
    (winner,) = [one.racer for one in answers[:2] if isinstance(one, Entry)]
    assert set(TimedSession.objects.values_list("entry__racer__alias", flat=True)) == {winner.alias}
    assert (TimedSession.objects.count(), standing(race, winner)[1]) == (2, 9_000)
    assert not Racer.objects.exclude(guest_name="").exists()


def test_a_crossing_that_comes_by_three_ways_at_once_is_one_crossing(race, organiser, now):
    alice = a_racer("alice")
    enter_race(race=race, racer=alice, now=now)
    sensor, _ = make_sensor(race=race, name="Gate", by=organiser, now=now)
    sent = replace(a_session(now, racer="alice", ended=False), sensor=sensor.pk, source="sensor", started_at=now)
    carry_over(race=race, by=organiser, sent=sent, now=now)
    for number, at_ms in ((1, 1_000), (2, 11_000)):
        answers = at_once(
            [lambda n=number, at=at_ms: take_crossing(sensor=sensor, number=n, at_ms=at, boot="a", now=now)] * 3
        )
        assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert Crossing.objects.count() == 2 and [lap.time_ms for lap in MeasuredLap.objects.all()] == [10_000]


def test_a_correction_and_what_a_device_sends_at_once_both_stand(race, organiser, now):
    alice = a_racer("alice")
    session = timed(race, alice, organiser, now, 10_000, ended=False)
    lap = session.laps.get()
    more = a_session(now, 10_000, 9_900, racer="alice")
    more = replace(more, id=session.pk, revision=2, laps=[replace(more.laps[0], id=lap.pk), more.laps[1]])
    answers = at_once(
        [
            lambda: correct_lap(lap=lap, by=organiser, reason="Mistyped", now=now, time_ms=9_000),
            lambda: carry_over(race=race, by=organiser, sent=more, now=now),
        ]
    )
    assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert [one.time_ms for one in MeasuredLap.objects.order_by("number")] == [9_000, 9_900]
    assert standing(race, alice)[1] == 9_000


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_postgresql_gives_the_same_guarantees(again_on_postgresql):
    again_on_postgresql(*(f"tests/races/test_timing{name}.py" for name in ("_at_once", "", "_guests", "_sensors")))
