"""Races of real cars in a season: points, stewards, what is told, and guests, who score once they are somebody."""

from __future__ import annotations

import json
import uuid
from datetime import timedelta

import pytest

from core.events import follow
from league.models import Membership, Notice, RoundPoints
from league.notices.sentences import sentence
from league.standings.selectors.outcomes import outcome_of
from league.standings.selectors.standings import season_standings
from league.stewarding.official_results import close_round
from league.webhooks.deliveries import deliver_due
from races.boards.selectors.board import board
from races.models import Guest, RankingMethod
from races.timing.services import carry_over, correct_lap, link_guest
from tests.factories import a_racer
from tests.happened import queue_deliveries, tell_what_happened
from tests.league.seasons import HOUR, a_round, after, cut_of
from tests.races.timing import a_lap, a_physical_race, a_session, timed
from tests.refusals import refused

pytestmark = pytest.mark.django_db
REAL = {"physical": True, "ranking_method": RankingMethod.BEST, "minimum_laps": 1, "off_track_penalty_ms": 1000}


@pytest.fixture
def steward(db):
    return a_racer("sam", is_staff=True)


@pytest.fixture
def clerk(db):
    """Who holds the race without being an admin."""
    return a_racer("clerk")


@pytest.fixture
def month(season, clerk):
    round_ = a_round(season, 1, "open-qualifier", **REAL)
    type(round_.race).objects.filter(pk=round_.race_id).update(organiser=clerk)
    round_.race.refresh_from_db()
    return round_


def points(season) -> list[tuple[str, int]]:
    names = dict(RoundPoints.objects.values_list("racer", "racer__alias"))
    return [(names[line.holder], line.points) for line in season_standings(season, "open")]


def a_guest(race, by, now, *times: int) -> Guest:
    id = uuid.uuid4()
    carry_over(race=race, by=by, sent=a_session(now, *times, guest=(id, "Mia Guest")), now=now)
    return Guest.objects.get(pk=id)


def test_a_round_of_real_cars_gives_points_and_promotes(season, month, clerk):
    driven = month.race.opens_at + HOUR
    for alias, time_ms in (("alice", 12_000), ("bob", 11_000), ("charlie", 13_000)):
        timed(month.race, a_racer(alias), clerk, driven, time_ms)
    close_round(round=month, now=after(month))
    assert points(season) == [("bob", 10), ("alice", 6), ("charlie", 3)]
    assert list(Membership.objects.values_list("racer__alias", flat=True)) == ["bob"]


def test_what_is_carried_over_or_corrected_after_the_close_moves_the_season(season, month, clerk, steward):
    driven, closed = month.race.closes_at - HOUR, after(month)
    alice, bob = a_racer("alice"), a_racer("bob")
    lap = timed(month.race, alice, clerk, driven, 12_000).laps.get()
    timed(month.race, bob, clerk, driven, 13_000)
    close_round(round=month, now=closed)
    assert points(season) == [("alice", 10), ("bob", 6)]
    # a device that had no network, within the 48 hours
    late = a_session(driven, 11_000, racer="bob")
    carry_over(race=month.race, by=clerk, sent=late, now=closed + HOUR)
    assert points(season) == [("bob", 10), ("alice", 6)]
    # the clerk corrects no more, a steward does
    refused("timing_stewards", correct_lap, lap=lap, by=clerk, reason="Cut", now=closed + HOUR, off_tracks=1)
    correct_lap(lap=lap, by=steward, reason="Mistyped", now=closed + 2 * HOUR, time_ms=10_000)
    assert points(season) == [("alice", 10), ("bob", 6)]
    assert list(Membership.objects.values_list("racer__alias", flat=True)) == ["alice"]


def test_once_the_window_is_over_no_way_in_changes_a_lap(season, month, clerk, steward):
    type(season).objects.update(steward_hours=24)
    driven = month.race.closes_at - HOUR
    lap = timed(month.race, a_racer("alice"), clerk, driven, 12_000).laps.get()
    guest = a_guest(month.race, clerk, driven, 11_000)
    close_round(round=month, now=after(month))
    final = after(month, hours=24, minutes=2)
    before = points(season)
    sent = a_session(driven, 9_000, racer="alice")
    for by in (clerk, steward):
        refused("timing_final", carry_over, race=month.race, by=by, sent=sent, now=final)
        refused("timing_final", correct_lap, lap=lap, by=by, reason="Late", now=final, time_ms=9_000)
        refused("timing_final", link_guest, guest=guest, racer=a_racer(), by=by, now=final)
    assert points(season) == before and lap.session.laps.get().time_ms == 12_000


def test_a_guest_keeps_the_rank_and_scores_when_somebody_takes_the_laps_over(season, month, clerk, steward):
    driven = month.race.closes_at - HOUR
    alice, bob = a_racer("alice"), a_racer("bob")
    guest = a_guest(month.race, clerk, driven, 10_000)
    timed(month.race, alice, clerk, driven, 11_000)
    cut = cut_of(month)
    assert cut is not None and cut.moved == frozenset() and outcome_of(month).promoted == []
    close_round(round=month, now=after(month))
    assert [(row.alias, row.rank) for row in board(month.race).rows] == [("Mia Guest", 1), ("alice", 2)]
    assert points(season) == [("alice", 6)] and not Membership.objects.exists()
    link_guest(guest=guest, racer=bob, by=steward, now=after(month, hours=1))
    assert points(season) == [("bob", 10), ("alice", 6)]
    assert list(Membership.objects.values_list("racer__alias", flat=True)) == ["bob"]


def test_guests_take_no_place_in_a_finale(season, clerk):
    round_ = a_round(season, 1, "pro-qualifier", **REAL)
    type(round_.race).objects.update(organiser=clerk)
    round_.race.refresh_from_db()
    driven = round_.race.opens_at + HOUR
    for number, alias in enumerate(("p1", "p2", "p3", "p4")):
        racer = a_racer(alias)
        Membership.objects.create(season=season, racer=racer, division="pro", since=round_.race.opens_at)
        timed(round_.race, racer, clerk, driven, 11_000 + number)
    a_guest(round_.race, clerk, driven, 9_000)
    close_round(round=round_, now=after(round_))
    assert list(round_.finale_places.order_by("place").values_list("racer__alias", flat=True)) == ["p1", "p2", "p3"]


def test_an_ended_session_is_told_to_its_racer_and_to_who_has_lost_the_lead(now, clerk):
    race = a_physical_race(now, name="Hall", organiser=clerk)
    alice, bob = a_racer("alice"), a_racer("bob")
    timed(race, alice, clerk, now, 12_000)
    tell_what_happened(now=now)
    assert [sentence(one) for one in Notice.objects.filter(racer=alice, kind="result")] == [
        "Your car in Hall: 0:12.000. No rivals yet."
    ]
    under_way = timed(race, bob, clerk, now, 11_000, ended=False)
    tell_what_happened(now=now)
    assert not Notice.objects.filter(racer=bob, kind="result").exists(), "a session under way is no result"
    laps = [a_lap(lap.number, lap.time_ms) for lap in under_way.laps.all()]
    ended = a_session(now, id=under_way.pk, revision=2, racer="bob", laps=laps)
    carry_over(race=race, by=clerk, sent=ended, now=now)
    tell_what_happened(now=now)
    follow("notices", now=now)
    said = [sentence(one) for one in Notice.objects.filter(racer=bob, kind="result")]
    assert said == ["Your car in Hall: 0:11.000. Place 1 of 2."]
    lost = Notice.objects.get(racer=alice, kind="lost_lead")
    assert sentence(lost) == "bob has taken the lead in Hall."


def test_a_guest_in_the_lead_is_told_by_name_and_is_told_nothing(now, clerk):
    race = a_physical_race(now, name="Hall", organiser=clerk)
    alice = a_racer("alice")
    timed(race, alice, clerk, now, 12_000)
    tell_what_happened(now=now)
    guest = a_guest(race, clerk, now, 11_000)
    tell_what_happened(now=now)
    assert sentence(Notice.objects.get(racer=alice, kind="lost_lead")) == "Mia Guest has taken the lead in Hall."
    assert not Notice.objects.filter(racer=guest.entry.racer_id).exists()


def test_a_webhook_of_the_organiser_hears_of_each_session_once(hook, alice, now, listener):
    race = a_physical_race(now, name="Hall", organiser=alice)
    session = timed(race, a_racer("bob"), alice, now, 11_000, 10_500)
    a_guest(race, alice, now, 12_000)
    queue_deliveries(now=now)
    queue_deliveries(now=now + timedelta(minutes=1))
    deliver_due(now=now + timedelta(minutes=1))
    said = [json.loads(body) for _headers, body in listener.heard]
    told = [(one["type"], one["race"]["name"], one["data"]) for one in said if one["type"] == "race.result"]
    standing = {"is_best": True, "classified": True}
    assert [what[:2] for what in told] == [("race.result", "Hall")] * 2
    assert told[0][2] == {
        "session": str(session.pk),
        "racer": "bob",
        "score_ms": 10_500,
        "best_lap_ms": 10_500,
        **standing,
    }
    assert told[1][2]["racer"] == "Mia Guest"
