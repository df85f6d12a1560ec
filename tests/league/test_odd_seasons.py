"""Seasons with unusual settings, and what may happen around the moment of closing."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from decimal import Decimal
from itertools import pairwise
from zoneinfo import ZoneInfo

import pytest

from accounts.models import Racer
from league.models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints
from league.seasons.selectors import hall_of_fame, racer_season
from league.seasons.services.race_changes import postpone_round
from league.seasons.services.season_plan import MonthPlan, SeasonPlan, schedule_season
from league.seasons.services.seasons import put_in_division
from league.standings.selectors.boards import field_of
from league.standings.selectors.outcomes import outcome_of
from league.standings.selectors.standings import season_standings
from league.stewarding.official_results import close_due_rounds, close_round
from league.stewarding.services import disqualify, put_back, reopen_round
from paddock.errors import UserFault
from races.boards.selectors.board import board as shown_board
from races.entries.services.entries import enter_race
from races.entries.services.submissions import submit_model
from races.models import Entry, Race
from races.pages.services import cancel_race, clone_race
from races.ranks import NOT_CLASSIFIED
from tests.factories import a_model, a_racer, a_track, finish, laps
from tests.league.seasons import HOUR, JANUARY, MONTH, a_round, a_season, after, board, racers, stand

pytestmark = pytest.mark.django_db


@pytest.fixture
def steward():
    return Racer.objects.create_superuser("steward", "steward@example.org", None)


def promoted() -> list[int]:
    return list(Membership.objects.exclude(promoted_in=None).order_by("place").values_list("racer", flat=True))


def code_of(call) -> str:
    with pytest.raises(UserFault) as caught:
        call()
    return caught.value.code


# --- settings ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "percent, classified, moved", [(50, 5, 3), (50, 1, 1), ("99.9", 10, 10), ("0.1", 10, 1), (50, 0, 0), ("12.5", 4, 1)]
)
def test_the_promoted_share_is_rounded_half_up_and_at_least_one(percent, classified, moved):
    round_ = a_round(a_season(promotion_percent=Decimal(percent)), 1, "open-qualifier")
    cast = racers(classified)
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    assert promoted() == [one.pk for one in cast[:moved]]


def test_a_round_without_classified_cars_has_no_consequences():
    round_ = a_round(a_season(), 1, "open-qualifier")
    for racer in racers(5):
        Entry.objects.create(
            race=round_.race, racer=racer, rank_score=NOT_CLASSIFIED - 120, achieved_at=round_.race.opens_at
        )
    close_round(round=round_, now=after(round_))
    assert promoted() == [] and not RoundPoints.objects.exists()


def test_a_season_with_empty_pro_races_can_finish():
    season = a_season()
    rounds = [a_round(season, 1, stage) for stage in ("open-qualifier", "pro-qualifier", "pro-finale")]
    rounds.append(a_round(season, 2, "championship"))
    closed = close_due_rounds(now=after(rounds[-1], days=1))
    assert sorted(one.pk for one in closed) == sorted(one.pk for one in rounds)
    assert not FinalePlace.objects.exists() and not ChampionshipPlace.objects.exists()
    (hall,) = hall_of_fame()
    assert hall.champion is None and hall.finales == []


def test_house_cars_are_on_a_board_but_count_for_nothing():
    round_ = a_round(a_season(promotion_percent=50), 1, "open-qualifier")
    cast, house = racers(4), [a_racer(is_house=True) for _ in range(6)]
    board(round_.race, house, first_ms=1000, is_baseline=True)
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    assert promoted() == [one.pk for one in cast[:2]], "two of four, not five of ten"
    assert [row.rank for row in shown_board(round_.race).rows] == [None] * 6 + [1, 2, 3, 4]
    assert list(RoundPoints.objects.order_by("rank").values_list("racer", flat=True)) == [one.pk for one in cast]


# --- ties ----------------------------------------------------------------------------------------------------------


def test_ties_at_the_promotion_line_follow_the_tie_breakers():
    round_ = a_round(a_season(promotion_percent=20), 1, "open-qualifier")
    first, *tied = racers(10)
    stand(round_.race, first, 20_000)
    ways = [
        {"resets": 1},
        {"achieved_at": round_.race.opens_at + 2 * HOUR},
        {"best_lap_ms": 29_000, "rank_lap": 29_000, "resets": 9, "achieved_at": round_.race.opens_at + 9 * HOUR},
        {},
        *[{"resets": 5}] * 5,
    ]
    for racer, way in zip(tied, ways, strict=True):
        stand(round_.race, racer, 30_000, **way)
    order = [row.entry.racer_id for row in shown_board(round_.race).rows]
    assert order[:5] == [first.pk, tied[2].pk, tied[3].pk, tied[1].pk, tied[0].pk]
    assert order[5:] == [one.pk for one in tied[4:]], "who came in first"
    close_round(round=round_, now=after(round_))
    assert promoted() == [first.pk, tied[2].pk]


def test_a_tie_for_the_last_finale_place_is_broken():
    season = a_season()
    pro, finale = a_round(season, 1, "pro-qualifier"), a_round(season, 1, "pro-finale")
    cast = racers(3)
    for racer in cast:
        put_in_division(season=season, racer=racer, division="pro", now=JANUARY)
    board(pro.race, cast)
    close_round(round=pro, now=after(pro))
    for racer, resets in zip(cast, (2, 0, 1), strict=True):
        stand(finale.race, racer, 9_000, resets=resets)
    close_round(round=finale, now=after(finale))
    assert list(ChampionshipPlace.objects.order_by("place").values_list("racer", flat=True)) == [cast[1].pk, cast[2].pk]


# --- stewards ------------------------------------------------------------------------------------------------------


@pytest.fixture
def raced():
    """A season raced to its end: ten racers, two promoted, both in the finale, one more pro by an admin's hand."""
    season = a_season()
    stages = ("open-qualifier", "pro-qualifier", "pro-finale")
    open_, pro, finale = (a_round(season, number, stage) for number, stage in zip((1, 2, 2), stages, strict=True))
    final = a_round(season, 3, "championship")
    cast = racers(10)
    board(open_.race, cast)
    close_round(round=open_, now=after(open_))
    put_in_division(season=season, racer=cast[5], division="pro", now=JANUARY)
    board(pro.race, [cast[0], cast[1], cast[5]])
    close_round(round=pro, now=after(pro))
    board(finale.race, [cast[1], cast[0], cast[5]])
    close_round(round=finale, now=after(finale))
    board(final.race, [cast[0], cast[1]])
    close_round(round=final, now=after(final))
    return season, cast, (open_, pro, finale, final)


def test_disqualifying_the_champion_crowns_the_next(raced, steward):
    _season, cast, (*_rounds, final) = raced
    assert hall_of_fame()[0].champion.racer == cast[0]
    disqualify(round=final, racer=cast[0], by=steward, reason="Cut.", now=after(final, hours=1))
    assert hall_of_fame()[0].champion.racer == cast[1]
    put_back(round=final, racer=cast[0], by=steward, reason="Seen.", now=after(final, hours=2))
    assert hall_of_fame()[0].champion.racer == cast[0]


def test_a_finalist_loses_the_place_only_within_the_window(raced, steward):
    season, cast, (_open, _pro, finale, final) = raced
    disqualify(round=finale, racer=cast[1], by=steward, reason="Cut.", now=after(finale, hours=1))
    qualified = list(ChampionshipPlace.objects.filter(season=season).order_by("place").values_list("racer", flat=True))
    assert qualified == [cast[0].pk, cast[5].pk] == field_of(final)
    late = after(finale, days=3)
    assert code_of(lambda: put_back(round=finale, racer=cast[1], by=steward, reason="Late.", now=late)) == (
        "steward_window_over"
    )
    assert field_of(final) == qualified


def test_a_disqualification_undoes_what_followed_a_promotion(raced, steward):
    _season, cast, (open_, *_rounds) = raced
    Round.objects.update(closed_at=after(raced[2][-1]))  # all became official late, so all of it can be corrected
    disqualify(round=open_, racer=cast[0], by=steward, reason="Cut.", now=after(raced[2][-1], hours=1))
    assert promoted() == [cast[1].pk, cast[2].pk], "a fifth of nine, rounded"
    assert set(outcome_of(Round.objects.get(pk=open_.pk)).promoted) == {(1, cast[1].pk), (2, cast[2].pk)}


def test_only_the_last_round_can_be_reopened_and_closes_the_same(raced, steward):
    _season, _cast, (_open, pro, finale, final) = raced
    Round.objects.update(closed_at=after(final))
    now = after(final, hours=1)
    assert code_of(lambda: reopen_round(round=pro, by=steward, reason="No.", now=now)) == "reopen_later_first"
    before = list(RoundPoints.objects.order_by("pk").values_list("round", "racer", "rank"))
    reopen_round(round=final, by=steward, reason="Protest.", now=now)
    assert hall_of_fame()[0].champion is None or hall_of_fame()[0].champion.round.closed_at is not None
    assert close_due_rounds(now=now) == [], "held back until an admin says so"
    close_round(round=Round.objects.get(pk=final.pk), now=now)
    assert list(RoundPoints.objects.order_by("pk").values_list("round", "racer", "rank")) == before
    assert finale.pk


# --- the moment of closing -----------------------------------------------------------------------------------------


def test_a_car_sent_just_before_the_close_counts():
    season = a_season()
    round_, late, intime = a_round(season, 1, "open-qualifier"), a_racer(), a_racer()
    closes = round_.race.closes_at
    submission = submit_model(
        race=round_.race, racer=intime, model=a_model(intime), now=closes - timedelta(microseconds=1)
    )
    assert code_of(lambda: submit_model(race=round_.race, racer=late, model=a_model(late), now=closes)) == "race_closed"
    assert code_of(lambda: close_round(round=round_, now=closes - timedelta(microseconds=1))) == "round_not_over"
    assert close_due_rounds(now=closes) == [], "a car that was sent in time is under way"
    finish(submission, laps(10_000, 10_000, 10_000), closes + timedelta(hours=5))
    assert close_due_rounds(now=closes + timedelta(hours=5)) == [round_] and promoted() == [intime.pk]


def test_a_postponed_round_closes_late_and_a_cancelled_one_never():
    season = a_season()
    first, second = (
        a_round(season, 1, "open-qualifier"),
        a_round(season, 2, "open-qualifier", opens_at=JANUARY + 2 * MONTH, closes_at=JANUARY + 3 * MONTH),
    )
    board(first.race, racers(5))
    old = first.race.closes_at
    postpone_round(round=first, hours=48, reason="Rain.", now=JANUARY + HOUR)
    assert close_due_rounds(now=old + HOUR) == []
    assert close_due_rounds(now=old + 48 * HOUR) == [first]
    cancel_race(race=second.race, reason="Rain.", now=JANUARY + HOUR)
    assert close_due_rounds(now=JANUARY + 9 * MONTH) == []
    assert code_of(lambda: postpone_round(round=second, hours=1, reason="No.", now=JANUARY + HOUR)) in (
        "race_cancelled",
        "race_is_over",
    )


def test_cloning_the_race_of_a_round_does_not_change_the_season():
    season = a_season()
    round_ = a_round(season, 1, "open-qualifier")
    board(round_.race, racers(5))
    clone = clone_race(race=round_.race, now=JANUARY)
    assert clone.slug != round_.race.slug and not Round.objects.filter(race=clone).exists()
    assert clone.entries.count() == 0 and season.rounds.count() == 1


def test_months_follow_the_wall_clock_through_daylight_saving():
    zone = ZoneInfo("America/New_York")
    track = a_track()
    months = [MonthPlan(month, track, track, "ccw") for month in range(1, 13)]
    plan = SeasonPlan(slug="ny", name="NY", year=2027, zone=zone, months=months, finale_hour=2)
    season, count = schedule_season(plan=plan, now=datetime(2026, 12, 1, tzinfo=UTC))
    assert count == 37
    opens = [
        one.race.opens_at.astimezone(zone) for one in season.rounds.filter(stage="open-qualifier").order_by("number")
    ]
    assert [(one.month, one.day, one.hour, one.minute) for one in opens] == [(n, 1, 0, 0) for n in range(1, 13)]
    assert {one.utcoffset() for one in opens} == {timedelta(hours=-5), timedelta(hours=-4)}
    races = list(Race.objects.filter(round__season=season, round__stage="open-qualifier").order_by("opens_at"))
    assert all(one.closes_at == two.opens_at for one, two in pairwise(races)), "not an hour is lost"
    assert season.starts_on == date(2027, 1, 1)


# --- racers who change ---------------------------------------------------------------------------------------------


def test_changing_team_or_country_keeps_earlier_points():
    season = a_season(promotion_percent=1)
    first, second = a_round(season, 1, "open-qualifier"), a_round(season, 2, "open-qualifier")
    winner, mate, other = (
        a_racer(country="KR", team="Reds"),
        a_racer(country="KR", team=" reds "),
        a_racer(country="DE"),
    )
    put_in_division(season=season, racer=winner, division="open", now=JANUARY)
    board(first.race, [winner, mate, other])
    close_round(round=first, now=after(first))
    Racer.objects.filter(pk=winner.pk).update(country="DE", team="Blues")
    board(second.race, [winner, mate, other])
    close_round(round=second, now=after(second))
    points = {line.holder: line.points for line in season_standings(season, "open", "countries")}
    assert points == {"KR": 10 + 6 + 6, "DE": 3 + 10 + 3}
    assert {line.holder: line.points for line in season_standings(season, "open", "teams")} == {"reds": 22, "blues": 10}
    assert season_standings(season, "open")[0].holder == winner.pk


def test_deleting_a_racer_keeps_the_places_of_the_others():
    season = a_season()
    round_ = a_round(season, 1, "open-qualifier")
    cast = racers(10)
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    cast[0].delete()
    assert promoted() == [cast[1].pk], "what was official stays so"
    assert list(RoundPoints.objects.order_by("rank").values_list("rank", "points")) == [(2, 6), (3, 3), (4, 1)]
    assert [row.rank for row in shown_board(round_.race).rows[:2]] == [1, 2]
    assert racer_season(season, cast[1])[0].rank == 1


def test_nobody_is_ever_in_two_divisions():
    season = a_season()
    first, second, pro = (
        a_round(season, 1, "open-qualifier"),
        a_round(season, 2, "open-qualifier"),
        a_round(season, 2, "pro-qualifier"),
    )
    cast = racers(5)
    board(first.race, cast)
    now = after(first)
    enter_race(race=second.race, racer=cast[0], now=first.race.closes_at - HOUR)
    close_round(round=first, now=now)
    # who had entered the next open race early and is a pro by now cannot send a car to it
    sent = lambda: submit_model(race=second.race, racer=cast[0], model=a_model(cast[0]), now=now)  # noqa: E731
    assert code_of(sent) == "race_open_only"
    assert enter_race(race=pro.race, racer=cast[0], now=now).race_id == pro.race_id
    assert code_of(lambda: enter_race(race=pro.race, racer=cast[1], now=now)) == "race_pro_only"
