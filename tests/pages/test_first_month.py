"""The first month of a season: what stands is shown, marked provisional, and nothing is a list of nobodies."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from datetime import datetime, timedelta

import pytest
from django.test import Client
from django.utils import timezone

from league.models import Round, Season, Stage
from league.seasons.services.seasons import create_season, schedule_round
from league.standings.selectors.finale_fields import fields_in_time, fields_of
from league.standings.selectors.months import months_of
from league.standings.selectors.tables import leaders_shown, running_rounds, standings_table
from league.stewarding.official_results import close_round
from races.models import Race
from tests.factories import a_racer, a_track
from tests.kept import Kept
from tests.league.seasons import board
from tests.pages.test_queries import queries

pytestmark = pytest.mark.django_db
MONTHS = 12
STANDINGS = "/seasons/first/standings/?division=open"
DAYS = timedelta(days=30)


@pytest.fixture(scope="session")
def kept_first_season(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, lambda: make_season(timezone.now()))


@pytest.fixture
def made(kept_first_season: Kept, db: None) -> tuple[Season, datetime]:
    return kept_first_season.copy()


@pytest.fixture
def season(made: tuple[Season, datetime]) -> Season:
    return made[0]


@pytest.fixture
def now(made: tuple[Season, datetime]) -> datetime:
    return made[1]


def make_season(now: datetime) -> tuple[Season, datetime]:
    """Twelve months of open and pro races with their finales, the first of them half over, and the time it is."""
    begins = now - DAYS / 2
    season = create_season(
        slug="first",
        name="New",
        starts_on=begins.date(),
        ends_on=(begins + DAYS * 14).date(),
        points=[25, 18, 15],
        finale_size=3,
        championship_places=2,
    )
    for number in range(1, MONTHS + 1):
        opens = begins + DAYS * (number - 1)
        for stage, at, lasts in (
            (Stage.OPEN, opens, DAYS),
            (Stage.PRO, opens, DAYS),
            (Stage.FINALE, opens + DAYS + timedelta(days=9), timedelta(days=1)),
        ):
            schedule_round(
                season=season,
                number=number,
                stage=stage,
                month=f"Month {number}",
                now=now,
                track=a_track(),
                name=f"Month {number} {stage.value}",
                opens_at=at,
                closes_at=at + lasts,
            )
    return season, now


def race(season: Season, number: int, stage: Stage) -> Race:
    return Round.objects.get(season=season, number=number, stage=stage).race


def words(path: str) -> str:
    response = Client().get(path)
    assert response.status_code == 200
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", response.content.decode().split("<main")[1])).split())


def test_first_month_standings_say_that_they_are_provisional(season):
    ann, ben = a_racer("ann", country="KR", team="Reds"), a_racer("ben", country="KR", team="reds")
    board(race(season, 1, Stage.OPEN), [ann, ben])
    page = words(STANDINGS)
    assert "provisional Including current results of rounds that are not official: Month 1 open-qualifier" in page
    assert re.search(r"1 (KR )?ann 25 25.*2 (KR )?ben 18 18", page)
    assert "1 43 43" not in page and re.search(
        r"KR .*43", words("/seasons/first/standings/?division=open&of=countries")
    )
    assert re.search(r"(?i)reds 43", words("/seasons/first/standings/?division=open&of=teams"))


def test_downloads_hold_official_rounds_only(season):
    board(race(season, 1, Stage.OPEN), [a_racer("ann")])
    assert "ann" not in Client().get("/seasons/first/standings.csv").content.decode()


def test_official_standings_link_to_the_provisional_ones(season, now):
    ann, ben = a_racer("ann"), a_racer("ben")
    first = race(season, 1, Stage.OPEN)
    board(first, [ann, ben])
    Race.objects.filter(pk=first.pk).update(opens_at=now - DAYS, closes_at=now - timedelta(days=1))
    close_round(round=Round.objects.get(race=first), now=now)
    second = race(season, 2, Stage.OPEN)
    Race.objects.filter(pk=second.pk).update(opens_at=now - timedelta(days=1))
    board(second, [ben])
    page = words(STANDINGS)
    assert "provisional" not in page.split("Points")[1] and re.search(r"ann 25 25", page)
    as_it_stands = words(f"{STANDINGS}&as=now")
    assert re.search(r"1 .{0,10}ben 43 18 25", as_it_stands) and "2* (provisional)" in as_it_stands


def test_the_overview_shows_a_provisional_leader_at_first(season, now):
    months = months_of(season)
    assert leaders_shown(season, 5, months, now) == []
    ann = a_racer("ann")
    board(race(season, 1, Stage.OPEN), [ann])
    (found,) = leaders_shown(season, 5, months_of(season), now)
    assert (found.division, [racer for _, racer in found.rows], found.is_provisional) == ("open", [ann], True)
    assert re.search(r"Open division provisional .*ann 25", words("/seasons/first/"))


def test_cancelled_and_unopened_races_are_not_running_rounds(season, now):
    first = race(season, 1, Stage.OPEN)
    board(first, [a_racer("ann")])
    board(race(season, 2, Stage.OPEN), [a_racer("early")])
    assert [one.race for one in running_rounds(months_of(season), "open", now)] == [first]
    Race.objects.filter(pk=first.pk).update(cancelled_at=now, cancel_reason="Rain.")
    assert running_rounds(months_of(season), "open", now) == []


def test_standings_without_results_link_to_the_race(season):
    assert "No racer classified yet. Be first: Month 1 open-qualifier" in words(STANDINGS)


def test_standings_say_when_the_first_race_opens(season, now):
    Race.objects.update(opens_at=now + timedelta(days=1), closes_at=now + timedelta(days=40))
    page = words(STANDINGS)
    assert "No round of this division is official yet. The next one opens" in page


def test_finales_start_with_the_next_and_list_no_racer_repeatedly(season):
    ann = a_racer("ann")
    board(race(season, 1, Stage.PRO), [ann])
    page = words("/seasons/first/finales/")
    assert "Nobody yet" not in page
    assert (
        page.index("Month 1 In the finale provisional") < page.index("Later finales") < page.index("Month 2 pro-finale")
    )
    assert page.count("In the finale") == 1 and page.count("pro-finale") == MONTHS
    assert re.search(r"In the finale provisional 1 .{0,5}ann", page)
    assert "Qualified for the championship Decided in this race, which opens" in page


def test_a_pro_race_nobody_finished_is_described_as_such(season):
    assert "No racer is classified in this race yet. It closes" in words("/seasons/first/finales/")


def test_past_finales_come_last_with_the_latest_first(season, now):
    for number in (1, 2):
        for stage in (Stage.PRO, Stage.FINALE):
            one = race(season, number, stage)
            at = now - timedelta(days=40 - 10 * number - (5 if stage == Stage.FINALE else 0))
            Race.objects.filter(pk=one.pk).update(opens_at=at - timedelta(days=1), closes_at=at)
            board(Race.objects.get(pk=one.pk), [a_racer()])
            close_round(round=Round.objects.get(race=one), now=at)
    months, _ = fields_of(season, months_of(season), now)
    found = fields_in_time(months, now)
    assert [one.month.number for one in found.past] == [2, 1]
    assert [one.month.number for one in found.next] == [3]
    assert [one.month.number for one in found.coming] == list(range(4, MONTHS + 1))


def test_provisional_standings_need_no_more_queries_for_more_racers(season):
    client = Client()
    first = race(season, 1, Stage.OPEN)
    board(first, [a_racer() for _ in range(3)])
    before = len(queries(client, STANDINGS))
    board(first, [a_racer() for _ in range(12)], first_ms=90_000)
    assert len(queries(client, STANDINGS)) == before
    months = months_of(season)
    table = standings_table(season, "open", "racers", months, running_rounds(months, "open", timezone.now()))
    assert len(table.rows) == 3, "places without points are not in it"
