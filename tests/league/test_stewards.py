"""What stewards can do to official results, and what follows."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.events import follow
from evaluation.models import Evaluation
from league.models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, StewardDecision
from league.seasons.selectors import decisions_of
from league.standings.selectors.standings import season_standings
from league.stewarding.official_results import close_due_rounds, close_round
from league.stewarding.services import disqualify, put_back, reopen_round
from paddock.errors import PlatformFault
from races.entries.services.entries import enter_race, remove_entry, withdraw
from races.entries.services.submissions import repeat_submission, submit_model
from races.models import Entry
from tests.factories import a_model, a_racer, fail, finish, laps
from tests.league.seasons import HOUR, a_round, after, board, cut_of, racers, stand
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def steward(db):
    return a_racer(is_staff=True)


def promoted(season) -> set[int]:
    return set(Membership.objects.filter(season=season, division="pro").values_list("racer", flat=True))


def test_a_disqualified_racers_place_goes_to_the_next(season, steward):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    close_round(round=january, now=after(january))
    decision = disqualify(
        round=january, racer=ten[0], by=steward, reason=" Two  accounts ", now=after(january, hours=1)
    )
    assert promoted(season) == {ten[1].pk, ten[2].pk}
    assert (decision.decision, decision.reason, decision.by) == ("disqualified", "Two accounts", steward)
    assert [line.holder for line in season_standings(season, "open")] == [one.pk for one in ten[1:5]]
    assert Entry.objects.get(racer=ten[0]).removal_reason == "Two accounts"
    put_back(round=january, racer=ten[0], by=steward, reason="A mistake of ours", now=after(january, hours=2))
    assert promoted(season) == {ten[0].pk, ten[1].pk}
    assert [one.decision for one in decisions_of(january)] == ["restored", "disqualified"]


def test_consequences_reach_through_the_whole_season(season, steward):
    """The winner of the pro race is disqualified after the finale was entered and the next pro race has begun."""
    season.steward_hours = 24 * 60
    season.save()
    ten = racers(10)
    january = a_round(season, 1, "open-qualifier")
    february, finale = a_round(season, 2, "pro-qualifier"), a_round(season, 2, "pro-finale")
    march = a_round(season, 3, "pro-qualifier")
    board(january.race, ten)
    close_due_rounds(now=after(january))
    board(february.race, [ten[0], ten[1], *ten[5:8]])
    close_due_rounds(now=after(february))
    assert set(finale.race.entries.values_list("racer", flat=True)) == {ten[0].pk, ten[1].pk, ten[5].pk}
    enter_race(race=march.race, racer=ten[1], now=after(february))
    moment = after(february, hours=2)
    disqualify(round=february, racer=ten[0], by=steward, reason="Seen driving by hand", now=moment)
    inside = finale.race.entries.filter(withdrawn_at=None)
    assert set(inside.values_list("racer", flat=True)) == {ten[1].pk, ten[5].pk, ten[6].pk}
    disqualify(round=january, racer=ten[1], by=steward, reason="Two accounts", now=moment)
    assert promoted(season) == {ten[0].pk, ten[2].pk}
    assert Entry.objects.get(race=march.race, racer=ten[1]).removed_at == moment, "no pro, no pro race"
    put_back(round=january, racer=ten[1], by=steward, reason="One account only", now=moment + HOUR)
    assert Entry.objects.get(race=march.race, racer=ten[1]).removed_at is None
    assert promoted(season) == {ten[0].pk, ten[1].pk}
    put_back(round=february, racer=ten[0], by=steward, reason="It drove by itself", now=moment + HOUR)
    inside = finale.race.entries.filter(withdrawn_at=None)
    assert set(inside.values_list("racer", flat=True)) == {ten[0].pk, ten[1].pk, ten[5].pk}
    board(finale.race, [ten[5], ten[1], ten[0]])
    close_due_rounds(now=after(finale))
    disqualify(round=finale, racer=ten[5], by=steward, reason="Late", now=after(finale, hours=1))
    qualified = ChampionshipPlace.objects.order_by("place").values_list("racer", flat=True)
    assert list(qualified) == [ten[1].pk, ten[0].pk]


def test_results_are_final_after_the_window(season, steward):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    close_round(round=january, now=after(january))
    late = after(january, hours=48, minutes=1)
    for call in (disqualify, put_back):
        refused("steward_window_over", call, round=january, racer=ten[0], by=steward, reason="x", now=late)
    refused("steward_window_over", reopen_round, round=january, by=steward, reason="x", now=late)
    # an entry that an admin removes all the same moves nobody
    remove_entry(entry=Entry.objects.get(racer=ten[0]), by=steward, now=late)
    assert promoted(season) == {ten[0].pk, ten[1].pk}


def test_removing_an_entry_within_the_window_has_consequences(season, steward):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    close_round(round=january, now=after(january))
    remove_entry(entry=Entry.objects.get(racer=ten[0]), by=steward, now=after(january))
    assert promoted(season) == {ten[1].pk, ten[2].pk}


def test_stewards_are_admins_and_must_give_reasons(season, steward, alice):
    january, ten = a_round(season, 1, "open-qualifier"), racers(3)
    board(january.race, ten)
    now = after(january)
    refused("steward_is_no_admin", disqualify, round=january, racer=ten[0], by=alice, reason="x", now=now)
    refused("steward_needs_a_reason", disqualify, round=january, racer=ten[0], by=steward, reason="  ", now=now)
    refused("not_in_the_race", disqualify, round=january, racer=alice, by=steward, reason="x", now=now)
    refused("round_not_official", reopen_round, round=january, by=steward, reason="x", now=now)
    assert not StewardDecision.objects.exists()


def test_a_disqualification_before_the_close_takes_effect_then(season, steward):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    disqualify(round=january, racer=ten[0], by=steward, reason="Two accounts", now=january.race.closes_at - HOUR)
    assert not Membership.objects.exists()
    close_round(round=january, now=after(january))
    assert promoted(season) == {ten[1].pk, ten[2].pk}


def test_reopened_results_become_official_only_by_hand(season, steward):
    january, five = a_round(season, 1, "pro-qualifier"), racers(5)
    finale = a_round(season, 1, "pro-finale")
    board(january.race, five)
    close_round(round=january, now=after(january))
    reopen_round(round=january, by=steward, reason="A run is driven again", now=after(january))
    january.refresh_from_db()
    assert january.closed_at is None and january.held_at == after(january)
    assert not FinalePlace.objects.exists() and not RoundPoints.objects.exists()
    assert not finale.race.entries.filter(withdrawn_at=None).exists()
    assert close_due_rounds(now=after(january, hours=1)) == []
    close_round(round=january, now=after(january, hours=1))
    assert finale.race.entries.filter(withdrawn_at=None).count() == 3 == FinalePlace.objects.count()
    assert Round.objects.get(pk=january.pk).held_at is None


def test_a_round_with_later_consequences_cannot_be_reopened(season, steward):
    season.steward_hours = 24 * 60
    season.save()
    january, february = a_round(season, 1, "pro-qualifier"), a_round(season, 2, "pro-qualifier")
    finale = a_round(season, 1, "pro-finale")
    close_due_rounds(now=after(january))
    opened = {"round": january, "by": steward, "reason": "x", "now": finale.race.opens_at + HOUR}
    assert refused("reopen_field_drives", reopen_round, **opened).params == {"race": finale.race.name}
    close_due_rounds(now=after(february))
    late = {"round": january, "by": steward, "reason": "x", "now": after(february)}
    assert refused("reopen_later_first", reopen_round, **late).params == {"race": february.race.name}


@pytest.mark.django_db(transaction=True)
def test_a_run_repeated_within_the_window_changes_the_season(season, wakes):
    january, racer = a_round(season, 1, "open-qualifier"), a_racer()
    four = racers(4)
    sent = january.race.closes_at - HOUR
    submission = submit_model(race=january.race, racer=racer, model=a_model(racer), now=sent)
    fail(submission, PlatformFault("sandbox_unavailable"), sent + timedelta(minutes=5))
    board(january.race, four)
    close_round(round=january, now=after(january))
    assert promoted(season) == {four[0].pk}
    again = repeat_submission(submission=submission, now=after(january))
    finish(again, laps(5_000, 5_000, 5_000), after(january, hours=1))
    follow("seasons", now=after(january, hours=1))
    assert promoted(season) == {racer.pk}
    assert Evaluation.objects.count() == 2


@pytest.mark.parametrize("late", [False, True], ids=["withdrawn at once", "withdrawn last"])
def test_a_month_with_a_tie_at_the_line_a_withdrawal_and_a_disqualification(season, steward, late):
    """Of ten a fifth moves: the line is below the second, between two of equal times of whom one came first."""
    month = a_round(season, 1, "open-qualifier")
    ten = racers(10)
    board(month.race, ten)
    for racer, hour in ((ten[1], 3), (ten[2], 2)):
        stand(month.race, racer, 31_000, achieved_at=month.race.opens_at + hour * HOUR)
    assert cut_of(month).moved == {ten[0].pk, ten[2].pk}
    withdraw(entry=Entry.objects.get(race=month.race, racer=ten[0]), now=after(month, minutes=-1 if late else -60))
    close_due_rounds(now=after(month))
    assert promoted(season) == {ten[2].pk, ten[1].pk}, "a fifth of nine is two, too"
    points = RoundPoints.objects.filter(round=month).order_by("rank").values_list("rank", "racer")
    assert list(points)[:2] == [(1, ten[2].pk), (2, ten[1].pk)]
    refused("race_closed", withdraw, entry=Entry.objects.get(race=month.race, racer=ten[1]), now=after(month))
    disqualify(round=month, racer=ten[2], by=steward, reason="A short cut.", now=after(month, hours=1))
    assert promoted(season) == {ten[1].pk, ten[3].pk}
    assert list(points.all())[:2] == [(1, ten[1].pk), (2, ten[3].pk)]
    put_back(round=month, racer=ten[2], by=steward, reason="An appeal.", now=after(month, hours=2))
    assert promoted(season) == {ten[2].pk, ten[1].pk}
