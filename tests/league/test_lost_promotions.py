"""A promotion that is lost takes with it what was driven in the pro division; what is locked stays."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from league.models import ChampionshipPlace, FinalePlace, Membership, RoundPoints
from league.seasons.services.race_changes import consequences_of
from league.seasons.services.succession import copy_season
from league.stewarding.official_results import close_due_rounds
from league.stewarding.services import disqualify, lock_round, put_back
from races.models import Entry, Race
from tests.factories import a_racer
from tests.kept import Kept
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers

pytestmark = pytest.mark.django_db


class Year:
    """January's open race has promoted two of ten; February's pro race, its finale and the championship are driven."""

    def __init__(self) -> None:
        self.season = a_season(steward_hours=24 * 60)
        self.steward = a_racer("steward", is_staff=True)
        self.ten = racers(10)
        self.january = a_round(self.season, 1, "open-qualifier")
        self.february = a_round(self.season, 2, "pro-qualifier")
        self.finale = a_round(self.season, 2, "pro-finale")
        self.championship = a_round(self.season, 2, "championship")
        board(self.january.race, self.ten)
        close_due_rounds(now=after(self.january))
        board(self.february.race, [self.ten[0], self.ten[1]])
        close_due_rounds(now=after(self.february))
        board(self.finale.race, [self.ten[0], self.ten[1]])
        close_due_rounds(now=after(self.finale))
        self.now = after(self.finale, hours=1)

    def disqualify(self, **options):
        return disqualify(
            round=self.january, racer=self.ten[0], by=self.steward, reason="Two accounts", now=self.now, **options
        )

    def of(self, model) -> list[int]:
        return list(model.objects.filter(racer=self.ten[0]).values_list("round", flat=True))


@pytest.fixture(scope="session")
def kept_year(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, Year)


@pytest.fixture
def year(kept_year: Kept, db: None) -> Year:
    return kept_year.copy()


def test_pro_points_finale_and_championship_places_go_with_the_promotion(year):
    assert len(year.of(RoundPoints)) == 2 and year.of(FinalePlace) and year.of(ChampionshipPlace)
    year.disqualify()
    assert not Membership.objects.filter(racer=year.ten[0]).exists()
    assert (year.of(RoundPoints), year.of(FinalePlace), year.of(ChampionshipPlace)) == ([], [], [])
    points = RoundPoints.objects.get(round=year.february)
    assert (points.racer, points.rank) == (year.ten[1], 1), "the others move up"
    assert ChampionshipPlace.objects.get().racer == year.ten[1]
    entered = year.championship.race.entries.filter(withdrawn_at=None)
    assert list(entered.values_list("racer", flat=True)) == [year.ten[1].pk]
    left = Entry.objects.filter(racer=year.ten[0], removed_at__isnull=False)
    assert left.count() == 4 and "Two accounts" in left.values_list("removal_reason", flat=True)


def test_all_of_it_comes_back_with_the_promotion(year):
    before = {
        model: set(model.objects.values_list("round", "racer", "place")) for model in (FinalePlace, ChampionshipPlace)
    }
    points = set(RoundPoints.objects.values_list("round", "racer", "rank", "points"))
    year.disqualify()
    put_back(round=year.january, racer=year.ten[0], by=year.steward, reason="One account", now=year.now + HOUR)
    for model, rows in before.items():
        assert set(model.objects.values_list("round", "racer", "place")) == rows
    assert set(RoundPoints.objects.values_list("round", "racer", "rank", "points")) == points
    assert not Entry.objects.filter(racer=year.ten[0], removed_at__isnull=False).exists()


def test_a_finale_place_that_is_lost_takes_the_championship_place(year):
    disqualify(round=year.february, racer=year.ten[0], by=year.steward, reason="By hand", now=year.now)
    assert Membership.objects.filter(racer=year.ten[0]).exists(), "the promotion stands"
    assert year.of(ChampionshipPlace) == [] and year.of(FinalePlace) == []
    assert Entry.objects.get(race=year.finale.race, racer=year.ten[0]).removed_at == year.now


def test_the_preview_says_what_changes_and_what_stays(year):
    alias = year.ten[0].alias
    lines = consequences_of(year.disqualify, year.season)
    january, february, finale = (one.race.name for one in (year.january, year.february, year.finale))
    for line in (
        f"{alias} is no longer promoted ({january}).",
        f"{alias} is no longer in the points ({february}).",
        f"{alias} is no longer in the finale ({february}).",
        f"{alias} is no longer qualified for the championship ({finale}).",
        f"{alias} is no longer on the board ({february}).",
        f"{alias} is no longer on the board ({finale}).",
        "Laps and runs stay to be looked into.",
    ):
        assert line in lines, lines
    assert year.of(ChampionshipPlace), "nothing was done"


def test_locked_results_stay_and_the_preview_says_so(year):
    lock_round(round=year.february, by=year.steward, reason="Prizes are paid", now=year.now)
    lines = consequences_of(year.disqualify, year.season)
    alias, february = year.ten[0].alias, year.february.race.name
    assert f"{alias} stays in the points ({february})." in lines
    assert f"{alias} stays in the finale ({february})." in lines
    year.disqualify()
    assert year.of(RoundPoints) == [year.february.pk] and year.of(FinalePlace) == [year.february.pk]
    assert Entry.objects.get(race=year.february.race, racer=year.ten[0]).removed_at is None


def test_who_was_a_pro_by_an_admins_word_keeps_what_they_drove(year):
    Membership.objects.filter(racer=year.ten[0]).update(promoted_in=None, place=None)
    year.disqualify()
    assert year.february.pk in year.of(RoundPoints) and year.of(ChampionshipPlace)


def test_the_season_that_continues_this_one_follows_too(year):
    copy = copy_season(season=year.season, now=year.now, months=12).season
    assert copy.follows == year.season
    assert set(copy.memberships.values_list("racer", flat=True)) == {year.ten[0].pk, year.ten[1].pk}
    pro = copy.rounds.select_related("race").get(stage="pro-qualifier")
    Race.objects.filter(pk=pro.race_id).update(opens_at=year.now - 2 * HOUR, closes_at=year.now - HOUR)
    board(pro.race, year.ten[:2])
    year.disqualify()
    assert set(copy.memberships.values_list("racer", flat=True)) > {year.ten[1].pk}
    assert Entry.objects.get(race=pro.race, racer=year.ten[0]).removed_at == year.now
    assert Entry.objects.get(race=pro.race, racer=year.ten[1]).removed_at is None
