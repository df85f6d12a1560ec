"""Records of real seasons of other years: nothing that happened is refused for its dates."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta

import pytest
from django.core.exceptions import ValidationError

from league.history.proof import proof_of
from league.history.season_export import export_season
from league.models import ChampionshipPlace, FinalePlace, Membership, Round
from races.pages.services import edit_race
from tests.league.histories import Recorded, write_season
from tests.league.records import bring, contents
from tests.league.seasons import HOUR, JANUARY, MONTH, a_round, a_season

pytestmark = pytest.mark.django_db
MONTHS = ("March", "April", "May", "June", "July", "August", "September", "October")


def times(*who: int) -> list[tuple[int, int | None]]:
    return [(racer, 30_000 + 1000 * place) for place, racer in enumerate(who)]


def of(year: int, month: int, day: int = 1, hour: int = 0, minute: int = 0) -> datetime:
    return datetime(year + (month - 1) // 12, (month - 1) % 12 + 1, day, hour, minute, tzinfo=UTC)


def finale_day(year: int, month: int) -> datetime:
    """The second Monday of the month, as the league of 2022 had it."""
    first = of(year, month, 1, 14, 1)
    return first + timedelta(days=(7 - first.weekday()) % 7 + 7)


def like_2022(year: int) -> list[Recorded]:
    """The races of 2022 at the same places of another year, with a few racers each: warm-ups that begin in the middle
    of a month, open and pro races that end a second before the next begin, finales in the weeks of the next month's
    races, a single race that ends in the next year."""
    end = timedelta(seconds=1)
    races = [
        Recorded("single", "Pre-season", of(year, 1, 4, 18, 35), of(year, 2) - end, times(1, 2, 3)),
        Recorded("open-qualifier", "Preseason", of(year, 2), of(year, 3) - end, times(*range(1, 21))),
        Recorded("single", "Winter Open", of(year, 12, 7, 20, 18), of(year, 14) - end, times(3, 4)),
    ]
    for number, name in enumerate(MONTHS, start=3):
        opens, closes = of(year, number), of(year, number + 1) - end
        pros = times(1, 2, *range(10, 10 + number))
        races.append(Recorded("open-qualifier", name, opens, closes, times(*range(3 * number, 3 * number + 20))))
        races.append(Recorded("pro-qualifier", name, opens, closes, pros))
        raced = finale_day(year, number + 1)
        races.append(Recorded("pro-finale", name, raced, raced + 5 * HOUR, times(*range(10, 10 + number))))
    return races


def finales_of(season) -> dict[str, int]:
    return dict(Round.objects.filter(season=season, stage="pro-finale").values_list("name", "number"))


def qualifiers_of(season) -> dict[str, int]:
    return dict(Round.objects.filter(season=season, stage="pro-qualifier").values_list("name", "number"))


@pytest.mark.parametrize("year", [2020, 2023, 2100])
def test_a_season_of_another_year_survives_import_and_export(tmp_path, year):
    folder = write_season(tmp_path / "in", like_2022(year), str(year))
    (season,) = bring(folder, now=of(year + 2, 1))
    assert season.rounds.count() == 27
    assert not season.rounds.filter(closed_at=None).exists(), "every race is official"
    assert finales_of(season) == qualifiers_of(season), "each finale is of its own month"
    proof = proof_of(season)
    assert proof["order"]["pairs"] == proof["order"]["agree"] > 0
    assert proof["championship"] == ChampionshipPlace.objects.filter(season=season).count() > 0
    assert export_season(season=season, folder=tmp_path / "out") == []
    assert contents(tmp_path / "out") == contents(folder)


def test_a_season_with_a_race_on_leap_day_only_is_imported(tmp_path):
    day = of(2024, 2, 29)
    races = [Recorded("open-qualifier", "Leap", day, day + 24 * HOUR - timedelta(seconds=1), times(1, 2, 3))]
    (season,) = bring(write_season(tmp_path, races, "2024"))
    assert (season.starts_on.isoformat(), season.rounds.get().closed_at.date().isoformat()) == (
        "2024-02-29",
        "2024-02-29",
    )


def test_several_years_with_returning_racers_are_imported(tmp_path):
    folder = tmp_path / "in"
    write_season(folder, like_2022(2023), "2023")
    rows = (folder / "races.csv").read_text()
    write_season(folder, like_2022(2024), "2024")
    again = (folder / "races.csv").read_text().split("\n", 1)[1]
    (folder / "races.csv").write_text(rows + again)
    assert [one.slug for one in bring(folder, now=of(2026, 1))] == ["2023", "2024"]
    assert Membership.objects.filter(season__slug="2024").exists(), "who was promoted in 2023 begins anew in 2024"


def with_a_late_finale(year: int) -> list[Recorded]:
    """April's finale lasts for weeks, and May's lies in the same weeks: both were driven before May's race closed."""
    races = [one for one in like_2022(year) if one.stage != "pro-finale" or one.name not in ("April", "May")]
    april = Recorded("pro-finale", "April", of(year, 5, 9), of(year, 6, 13), times(10, 11, 12, 13))
    may = Recorded("pro-finale", "May", of(year, 5, 16), of(year, 5, 30), times(11, 14, 10, 15, 13))
    return [*races, april, may]


def test_overlapping_finales_qualify_nobody_twice(tmp_path):
    folder = write_season(tmp_path / "in", with_a_late_finale(2021), "2021")
    (season,) = bring(folder, now=of(2023, 1))
    assert finales_of(season) == qualifiers_of(season)
    qualified = list(ChampionshipPlace.objects.filter(season=season).values_list("racer", flat=True))
    assert len(qualified) == len(set(qualified)) > 0
    by_round = ChampionshipPlace.objects.filter(season=season).order_by("place").values_list
    may = by_round("racer__alias", flat=True).filter(round__name="May")
    april = by_round("racer__alias", flat=True).filter(round__name="April")
    held = set(by_round("racer__alias", flat=True).filter(round__name="March"))
    assert list(may) == [f"racer-000{n}" for n in (11, 14, 10, 15, 13) if f"racer-000{n}" not in held][:3]
    assert not set(april) & (set(may) | held), "May's closed first, and April's gives its places to others"
    export_season(season=season, folder=tmp_path / "out")
    assert contents(tmp_path / "out") == contents(folder)


@pytest.mark.parametrize("stage", ["open-qualifier", "pro-qualifier", "championship"])
def test_overlapping_races_of_one_division_are_imported(tmp_path, stage):
    """As in 2020, whose months had a time trial, object avoidance and head-to-head at once."""
    races = [
        Recorded(stage, f"May {kind}", of(2020, 5), of(2020, 6), times(1, 2, 3), {"race_type": kind})
        for kind in ("time_trial", "object_avoidance", "head_to_head_racing")
    ]
    (season,) = bring(write_season(tmp_path, races, "2020"))
    assert sorted(season.rounds.values_list("number", flat=True)) == [1, 2, 3]


def test_the_order_of_rows_does_not_change_rounds(tmp_path):
    races = with_a_late_finale(2021)
    straight = write_season(tmp_path / "straight", races, "2021")
    random.Random(7).shuffle(races)
    mixed = write_season(tmp_path / "mixed", races, "2022")
    shown = [
        sorted(season.rounds.values_list("number", "stage", "name"))
        for season in (*bring(straight, now=of(2023, 1)), *bring(mixed, now=of(2023, 1)))
    ]
    assert shown[0] == shown[1]
    places = [
        sorted(FinalePlace.objects.filter(round__season__slug=slug).values_list("round__name", "racer", "place"))
        for slug in ("2021", "2022")
    ]
    assert places[0] == places[1]


def test_a_renamed_finale_belongs_to_the_last_pro_race_without_one(tmp_path):
    """A record may name a finale after its own month: it is held to the calendar then."""
    races = [
        Recorded("pro-qualifier", "April", of(2021, 4), of(2021, 5), times(1, 2, 3)),
        Recorded("pro-qualifier", "May", of(2021, 5), of(2021, 6), times(1, 2, 3)),
        Recorded("pro-finale", "Spring Finale", of(2021, 5, 10), of(2021, 6, 20), times(1, 2)),
        Recorded("pro-finale", "Summer Finale", of(2021, 6, 10), of(2021, 6, 18), times(2, 3)),
    ]
    (season,) = bring(write_season(tmp_path, races, "2021"))
    numbers = dict(season.rounds.values_list("name", "number"))
    assert numbers["Spring Finale"] == numbers["April"] and numbers["Summer Finale"] == numbers["May"]


def test_an_overlapping_season_works_like_any_other(tmp_path, client):
    (season,) = bring(write_season(tmp_path, with_a_late_finale(2021), "2021"), now=of(2023, 1))
    for page in ("", "calendar/", "finales/", "standings/", "rules/"):
        answer = client.get(f"/seasons/2021/{page}")
        assert answer.status_code in (200, 302), page
    for round_ in season.rounds.select_related("race"):
        round_.full_clean()
        if round_.name in ("April", "May"):  # whose finales overlap
            assert client.get(round_.race.get_absolute_url()).status_code == 200, round_


# --- seasons that are made here --------------------------------------------------------------------------------------


def test_finales_of_a_local_season_may_overlap_too():
    season = a_season()
    now = JANUARY - timedelta(days=1)
    for number in (1, 2):
        a_round(season, number, "pro-qualifier")
    first = a_round(season, 1, "pro-finale")
    second = a_round(season, 2, "pro-finale")
    edit_race(race=first.race, now=now, closes_at=second.race.closes_at + HOUR)
    assert first.race.closes_at > second.race.opens_at
    with pytest.raises(ValidationError):
        a_round(season, 3, "pro-qualifier", opens_at=JANUARY + MONTH / 2)
