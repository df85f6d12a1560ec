"""No page asks the database more often the more there is to show."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import timedelta

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.following import follow_racer
from benchmarks import pages
from benchmarks.page_rows import BOARD, Site, make_site
from evaluation.models import Evaluation
from league.models import Membership, Notice, Round, RoundPoints, Stage
from league.seasons.services.seasons import create_season
from races.entries.selectors.lists import STATES
from races.models import Entry, Race
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, drive, finish, laps
from tests.kept import Kept
from tests.kept_parts import parts_are_kept
from tests.live_shows import a_live_race, an_ended_show
from tests.pages.conftest import World
from tests.pages.test_pages import address
from tests.training.jobs import a_training
from training.models import Vehicle

# one of them says up to which event the page shows everything; a race asks for its live event, the reader's groups and
# class
LIMIT = 17
# session, racer, notices, and what a page shows of the reader alone
FEW = 8
MORE_ALONE = {"/": 3}  # the reader's class, and cars on track
PATHS = (
    "/",
    "/about/",
    "/races/",
    "/races/?show=closed",
    "/races/open-race/",
    "/races/open-race/rules/",
    "/races/open-race/runs/",
    "/races/open-race/racers/",
    "/races/open-race/edit/",
    "/models/",
    "/models/{model}/",
    "/tracks/",
    "/tracks/oval/",
    "/settings/",
    "/settings/tokens/",
    "/evaluations/{finished}/",
    "/evaluations/{queued}/",
    "/evaluations/{queued}/live/",
)


def queries(client, path: str) -> list[str]:
    """The statements that a page sends whose shared parts were made for an earlier reader, without those that keep the
    transaction."""
    with parts_are_kept():
        assert client.get(path).status_code == 200
        with CaptureQueriesContext(connection) as captured:
            assert client.get(path).status_code == 200
    words = ("SAVEPOINT", "RELEASE", "BEGIN", "COMMIT")
    return [query["sql"] for query in captured if not query["sql"].startswith(words)]


@pytest.mark.parametrize("path", PATHS)
def test_a_page_needs_few_queries(world: World, path: str) -> None:
    sent = queries(world.client("alice"), address(world, path))
    assert len(sent) <= LIMIT, "\n".join(sent)


@pytest.mark.parametrize("path", ["/", "/about/", *(f"/races/?show={show}" for show in ("", *STATES, "mine"))])
@pytest.mark.parametrize("viewer", ["newcomer", "bob"])
def test_pages_of_shared_parts_need_few_queries(world: World, viewer: str, path: str) -> None:
    """Without a car, and with results and a car that drives."""
    sent = queries(world.client(viewer), path)
    assert len(sent) <= FEW + MORE_ALONE.get(path, 0), "\n".join(sent)


@pytest.mark.parametrize("viewer", ["newcomer", "alice", "bob", "admin"])
def test_profiles_need_few_queries(world: World, viewer: str) -> None:
    """Alice has a private race, which bob is not in: her own profile, hers for others, and one without."""
    for racer in ("alice", "bob"):
        sent = queries(world.client(viewer), f"/racers/{racer}/")
        assert len(sent) <= FEW, "\n".join(sent)


def test_a_waiting_car_costs_the_race_page_no_more_queries(world: World) -> None:
    """Its place in the queue comes with the first look of the box that follows it."""
    assert Evaluation.objects.filter(submission=world.queued, state="queued").exists()
    client = world.client("alice")
    sent = queries(client, "/races/waiting-race/")
    assert len(sent) <= LIMIT, "\n".join(sent)
    assert 'hx-trigger="load, paddock:moved"' in client.get("/races/waiting-race/").content.decode()
    assert "In queue:" in client.get("/races/waiting-race/live/").content.decode()


@pytest.mark.parametrize(
    "path", ["/", "/races/", "/races/open-race/", "/models/", "/models/{model}/", "/racers/alice/", "/tracks/oval/"]
)
def test_more_rows_need_no_more_queries(world: World, path: str) -> None:
    client = world.client("alice")
    address_ = address(world, path)
    before = len(queries(client, address_))
    for number in range(2):
        race = a_race(world.now, name=f"Another {number}")
        drive(world.race, a_racer(), laps(10_300 + number, 10_300, 10_300), world.now)
        drive(race, world.alice, laps(9_000, 9_100, 9_200), world.now)
        a_model(world.alice)
    assert len(queries(client, address_)) <= before


def test_a_new_run_that_is_like_no_race_looks_for_none(world: World) -> None:
    assert not [sql for sql in queries(world.client("alice"), "/runs/new/") if "\"slug\" = ''" in sql]


LOOKING = ("no car", "results", "admin")
CASES = [(page, reader) for page, readers in pages.READERS.items() for reader in readers if reader in LOOKING]


@dataclass
class Grown:
    """A site with a history, and what each page sent before more rows came."""

    site: Site
    before: dict[tuple[str, str], list[str]]


@pytest.fixture(scope="session")
def kept_grown(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _grown)


@pytest.fixture
def grown(kept_grown: Kept, db: None) -> Grown:
    return kept_grown.copy()


def _grown() -> Grown:
    site = make_site(timezone.now(), big=True, racers=BOARD, races=50, runs=1_500)
    return Grown(site, {case: _sent(site, *case) for case in CASES})


def _sent(site: Site, page: str, reader: str) -> list[str]:
    ask = pages.request(site, page, site.readers[reader])
    ask()  # the first loads what the process keeps
    return pages.statements(ask)[0]


def _more_rows(site: Site) -> Site:
    """The same site with more of everything that a page lists."""
    now, mine = timezone.now(), site.readers["results"]
    organiser = site.readers["organiser"]
    season = site.month.round.season
    for number in range(4):
        race = a_race(now, name=f"Another {number}", organiser=organiser)
        drive(site.month, racer := a_racer(country="KR"), laps(20_300 + number, 20_300, 20_300), now)
        drive(race, mine, laps(19_000, 19_100, 19_200), now)
        drive(race, racer, laps(19_000, 19_100, 19_200), now)
        drive(site.month, mine, laps(18_000 + number, 18_100, 18_200), now)
        a_model(mine)
        a_training(mine, race.track, now, name=f"another-{number}")
        Vehicle.objects.create(owner=mine, name=f"Another {number}", sensors=["FRONT_FACING_CAMERA"])
        own = drive_own(owner=mine, model=a_model(mine), track=race.track, now=now)
        finish(own, laps(9_000, 9_000, 9_000), now)
        follow_racer(follower=mine, racer=racer, now=now)
        Notice.objects.create(racer=mine, kind="result", about=f"{number}", params={"race": race.name}, at=now)
        years = (now + timedelta(days=1000 + 400 * number)).date()
        create_season(slug=f"s{number}", name=f"S{number}", starts_on=years, ends_on=years + timedelta(days=300))
        _in_the_standings(racer, season.pk, number)
    show = a_live_race(now, organiser, slug="long-show", name="Long show")
    times = {name: (9_000 + 100 * place,) for place, name in enumerate(("results", *(f"live-{n}" for n in range(5))))}
    an_ended_show(now - timedelta(minutes=30), organiser, race=show, end=False, laps=times)
    return replace(site, paths=site.paths | {"live event": f"{show.get_absolute_url()}event/"})


def _in_the_standings(racer: object, season: int, number: int) -> None:
    closed = Round.objects.filter(season=season, stage=Stage.OPEN, closed_at__isnull=False).order_by("pk")
    for round_ in closed:
        RoundPoints.objects.create(round=round_, racer=racer, rank=1_000 + number, points=5, country="KR")
    Membership.objects.create(
        season_id=season, racer=racer, division="pro", promoted_in=closed.last(), place=1_000 + number
    )


@pytest.mark.slow
@pytest.mark.usefixtures("wakes")
def test_pages_of_a_site_with_a_history_need_no_more_queries_for_more_rows(grown: Grown) -> None:
    assert Membership.objects.filter(season=grown.site.month.round.season).exists(), "past months are official"
    assert not Entry.objects.filter(race=grown.site.month, racer__alias="r1", best=None).exists()
    assert Race.objects.count() > 50 and Evaluation.objects.count() > 1_000
    larger = _more_rows(grown.site)
    over, grown_by = {}, {}
    for case, before in grown.before.items():
        after = _sent(larger, *case)
        if len(after) > len(before):
            shapes = [re.sub(r"\d+|'[^']*'", "?", sql) for sql in before]
            grown_by[case] = [sql for sql in after if re.sub(r"\d+|'[^']*'", "?", sql) not in shapes]
        if case[1] == "results" and len(after) > pages.QUERIES:
            over[case[0]] = len(after)
    print(f"more than {pages.QUERIES} queries as a racer: {over}")
    assert grown_by == {}
