"""Sensors: crossings become laps by the sensor's own clock, once each, whatever the network does."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest

from paddock.errors import UserFault
from races.models import Crossing, Entry, MeasuredLap, TimedSession
from races.timing.services import SentLap, carry_over, make_sensor, revoke_sensor, sensor_with, take_crossing
from tests.factories import a_racer
from tests.races.test_timing import refused
from tests.races.timing import a_physical_race, a_session, standing

pytestmark = pytest.mark.django_db


@pytest.fixture
def organiser():
    return a_racer("olga")


@pytest.fixture
def race(now, organiser):
    return a_physical_race(now, organiser=organiser)


@pytest.fixture
def alice(race):
    racer = a_racer("alice")
    Entry.objects.create(race=race, racer=racer)
    return racer


@pytest.fixture
def sensor(race, organiser, now):
    return make_sensor(race=race, name="Gate", by=organiser, now=now)[0]


@pytest.fixture
def session(race, organiser, sensor, alice, now):
    sent = a_session(now, racer="alice", sensor=sensor.pk, ended=False, started_at=now)
    return carry_over(race=race, by=organiser, sent=sent, now=now)


def times(session) -> list[int]:
    return list(session.laps.order_by("number").values_list("time_ms", flat=True))


def test_a_lap_is_the_difference_of_two_crossings_on_the_sensors_clock(sensor, session, race, alice, now):
    """However late each arrives, and whatever the sensor's clock began at."""
    for number, (at_ms, late) in enumerate([(5_000_000, 0), (5_010_123, 20), (5_019_500, 21)], 1):
        arrives = now + timedelta(seconds=late)
        take_crossing(sensor=sensor, number=number, at_ms=at_ms, boot="a", now=arrives)
    assert times(session) == [10_123, 9_377]
    assert standing(race, alice)[1] == 9_377


def test_without_a_clock_of_its_own_the_time_of_receiving_stands(sensor, session, now):
    for number, seconds in enumerate((0, 10, 19.5), 1):
        take_crossing(sensor=sensor, number=number, now=now + timedelta(seconds=seconds))
    assert times(session) == [10_000, 9_500]


def test_a_crossing_sent_again_is_the_same_one(sensor, session, now):
    for number, at_ms in ((1, 0), (2, 10_000), (2, 10_000), (1, 0)):
        taken = take_crossing(sensor=sensor, number=number, at_ms=at_ms, now=now)
    assert taken.again and taken.verdict == "start"
    assert times(session) == [10_000] and Crossing.objects.count() == 2


def test_two_crossings_within_the_shortest_lap_are_one(sensor, session, now):
    verdicts = [
        take_crossing(sensor=sensor, number=number, at_ms=at_ms, now=now + timedelta(milliseconds=at_ms)).verdict
        for number, at_ms in enumerate((0, 40, 10_000, 10_030, 12_999, 20_000), 1)
    ]
    assert verdicts == ["start", "bounce", "lap", "bounce", "bounce", "lap"]
    assert times(session) == [10_000, 10_000]


def test_a_clock_that_stands_or_goes_back_is_noticed(sensor, session, now):
    take_crossing(sensor=sensor, number=1, at_ms=70_000, now=now)
    later = now + timedelta(seconds=9)
    for code, at_ms in (("sensor_clock_stands", 70_000), ("sensor_clock_back", 69_000)):
        refused(code, lambda at_ms=at_ms: take_crossing(sensor=sensor, number=2, at_ms=at_ms, now=later))
    assert Crossing.objects.count() == 1


def test_a_sensor_that_starts_anew_begins_a_lap_and_ends_none(sensor, session, now):
    take_crossing(sensor=sensor, number=1, at_ms=70_000, boot="a", now=now)
    assert take_crossing(sensor=sensor, number=1, at_ms=900, boot="b", now=now).verdict == "start"
    take_crossing(sensor=sensor, number=2, at_ms=10_900, boot="b", now=now)
    assert times(session) == [10_000]


def test_a_lap_of_a_year_begins_anew(sensor, session, now):
    take_crossing(sensor=sensor, number=1, at_ms=0, now=now)
    taken = take_crossing(sensor=sensor, number=2, at_ms=365 * 86_400_000, now=now + timedelta(seconds=9))
    assert taken.verdict == "start" and times(session) == []


def test_the_lap_begun_when_the_session_is_over_is_its_last(sensor, session, now):
    for number, seconds in enumerate((0, 170, 185), 1):
        take_crossing(sensor=sensor, number=number, at_ms=seconds * 1000, now=now + timedelta(seconds=seconds))
    session.refresh_from_db()
    assert times(session) == [170_000, 15_000] and session.ended_at == now + timedelta(seconds=185)
    late = now + timedelta(seconds=195)
    refused("sensor_idle", lambda: take_crossing(sensor=sensor, number=4, at_ms=195_000, now=late))


def test_the_timekeeper_marks_laps_of_the_sensor_and_does_not_time_them(sensor, session, race, organiser, alice, now):
    take_crossing(sensor=sensor, number=1, at_ms=0, now=now)
    lap = take_crossing(sensor=sensor, number=2, at_ms=10_000, now=now).lap
    marked = SentLap(id=lap.pk, number=1, time_ms=1, off_tracks=2)
    sent = a_session(now, racer="alice", id=session.pk, sensor=sensor.pk, revision=2, ended=False, laps=[marked])
    carry_over(race=race, by=organiser, sent=sent, now=now)
    assert times(session) == [10_000] and standing(race, alice)[1] == 12_000


def test_one_session_runs_at_a_sensor(sensor, session, race, organiser, now):
    other = a_session(now, racer="alice", sensor=sensor.pk, ended=False, started_at=now)
    refused("sensor_busy", lambda: carry_over(race=race, by=organiser, sent=other, now=now))
    later = now + timedelta(minutes=24)
    assert carry_over(race=race, by=organiser, sent=replace(other, started_at=later), now=later)
    session.refresh_from_db()
    assert session.ended_at == later


def test_without_a_session_nothing_counts(sensor, now):
    refused("sensor_idle", lambda: take_crossing(sensor=sensor, number=1, at_ms=0, now=now))
    assert not Crossing.objects.exists()


def test_a_token_is_kept_as_a_digest_and_ends_when_it_is_revoked(race, organiser, now):
    sensor, text = make_sensor(race=race, name="Gate", by=organiser, now=now)
    assert text.startswith("pds_") and text not in repr(vars(sensor))
    assert sensor_with(text) == sensor
    for wrong in ("", "pds_x", text[:-1]):
        refused("sensor_token", lambda wrong=wrong: sensor_with(wrong))
    revoke_sensor(sensor=sensor, by=organiser, now=now)
    refused("sensor_revoked", lambda: sensor_with(text))


def test_a_revoked_sensor_times_nothing_more(sensor, session, race, organiser, now):
    take_crossing(sensor=sensor, number=1, at_ms=0, now=now)
    revoke_sensor(sensor=sensor, by=organiser, now=now)
    with pytest.raises(UserFault):
        take_crossing(sensor=sensor, number=2, at_ms=10_000, now=now)
    assert not MeasuredLap.objects.exists() and TimedSession.objects.get().ended_at == now


def test_only_the_organiser_makes_and_revokes_sensors(sensor, race, alice, now):
    refused("race_not_yours", lambda: make_sensor(race=race, name="x", by=alice, now=now))
    refused("race_not_yours", lambda: revoke_sensor(sensor=sensor, by=alice, now=now))


def test_after_the_race_no_session_begins_and_what_runs_goes_on(sensor, race, organiser, alice, now):
    last = race.closes_at - timedelta(seconds=1)
    sent = a_session(now, racer="alice", sensor=sensor.pk, ended=False, started_at=last)
    carry_over(race=race, by=organiser, sent=sent, now=last)
    take_crossing(sensor=sensor, number=1, at_ms=0, now=last)
    take_crossing(sensor=sensor, number=2, at_ms=10_000, now=last + timedelta(seconds=10))
    assert standing(race, alice)[1] == 10_000
    later = replace(sent, id=a_session(now).id, started_at=race.closes_at)
    refused("race_closed", lambda: carry_over(race=race, by=organiser, sent=later, now=race.closes_at))
