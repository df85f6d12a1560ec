"""No page asks the database more often the more there is to show."""

from __future__ import annotations

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from evaluation.models import Evaluation
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.pages.conftest import World
from tests.pages.test_pages import address

# one of them says up to which event the page shows everything; a race asks for its live event, the reader's groups and
# class, a profile for cups won and who stood before whom
LIMIT = 17
# one's own: the rivals as well
MORE = {"/racers/alice/": LIMIT + 4}
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
    "/racers/alice/",
    "/settings/",
    "/settings/tokens/",
    "/evaluations/{finished}/",
    "/evaluations/{queued}/",
    "/evaluations/{queued}/live/",
)


def queries(client, path: str) -> list[str]:
    """The statements that a page sends, without those that keep the transaction."""
    with CaptureQueriesContext(connection) as captured:
        assert client.get(path).status_code == 200
    words = ("SAVEPOINT", "RELEASE", "BEGIN", "COMMIT")
    return [query["sql"] for query in captured if not query["sql"].startswith(words)]


@pytest.mark.parametrize("path", PATHS)
def test_a_page_needs_few_queries(world: World, path: str) -> None:
    sent = queries(world.client("alice"), address(world, path))
    assert len(sent) <= MORE.get(path, LIMIT), "\n".join(sent)


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
    for number in range(4):
        race = a_race(world.now, name=f"Another {number}")
        drive(world.race, a_racer(), laps(10_300 + number, 10_300, 10_300), world.now)
        drive(race, world.alice, laps(9_000, 9_100, 9_200), world.now)
        a_model(world.alice)
    assert len(queries(client, address_)) <= before
