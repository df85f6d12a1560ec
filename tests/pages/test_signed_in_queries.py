"""Pages of signed-in racers: at most eight queries once what all readers share is there, and nobody's private piece."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from django.db import connection, connections
from django.test import Client
from django.utils import timezone

from accounts.groups.services import make_group
from accounts.models import GroupMember, Racer
from accounts.teams.services import found_team
from league.models import Stage
from league.seasons.services.seasons import create_season
from races.models import Race, Visibility
from tests.courses.assignments import a_group, an_assignment, hand_in
from tests.evaluation import reports
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.kept import Kept
from tests.kept_parts import parts_are_kept
from tests.league.seasons import a_round, board
from tests.live_shows import a_live_race, a_show, begun
from tests.pages.conftest import World, make_world
from tests.pages.test_pages import address
from tests.pages.test_queries import queries
from tests.training.jobs import a_sweep_row, a_trained_one
from training.models import SweepState, TrainingJob

LIMIT = 8
MORE = {"/assignments/{task}/": 2}  # attempts with their runs, extension, submission group, mark, cars
PATHS = (
    "/models/",
    "/models/upload/",
    "/models/shared/",
    "/models/{model}/edit/",
    "/models/{model}/delete/",
    "/models/{model}/",
    "/train/",
    "/train/new/",
    "/train/{training}/",
    "/train/{training}/delete/",
    "/train/sweeps/{sweep}/",
    "/train/sweeps/{sweep}/delete/",
    "/vehicles/",
    "/vehicles/new/",
    "/learn/",
    "/learn/laboratory/",
    "/runs/",
    "/runs/new/",
    "/runs/new/?like=open-race",
    "/classes/",
    "/assignments/",
    "/assignments/{task}/",
    "/groups/",
    "/groups/new/",
    "/reports/",
    "/reports/new/",
    "/reports/new/?model={model}",
    "/reports/{report}/",
    "/evaluations/{queued}/",
    "/evaluations/{queued}/live/",
    "/evaluations/{failed}/",
    "/evaluations/{finished}/",
    "/evaluations/{other}/",
    "/evaluations/{finished}/replay/",
    "/races/show/event/",
    "/races/show/event/state.json",
    "/following/",
    "/train/new/?clone={model}",
    "/settings/alias/",
    "/settings/data/",
    *("/settings/", "/settings/usage/", "/settings/notices/", "/settings/webhooks/", "/settings/tokens/"),
)


@pytest.fixture
def shared(settings) -> Iterator[None]:
    settings.TRAINING = True
    with parts_are_kept():
        yield


@pytest.fixture(scope="session")
def kept_busy_world(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _busy_world, fresh_s=20.0)  # as of the pages' world


@pytest.fixture
def busy(kept_busy_world: Kept, db: None, shared: None) -> tuple[World, dict[str, str]]:
    return kept_busy_world.copy()


def _busy_world() -> tuple[World, dict[str, str]]:
    """Alice has something of everything, and all her races are public; and what addresses name of hers."""
    world = make_world()
    now, alice = world.now, world.alice
    Race.objects.filter(pk=world.secret.pk).update(visibility=Visibility.PUBLIC)
    race = a_live_race(now, world.bob, slug="show", name="Show")
    begun(a_show(now, world.bob, ["alice", "bob"], race=race), world.bob, now)
    make_group(by=alice, name="Owls", now=now)
    found_team(by=alice, name="Comets", now=now)
    report = reports.a_report(alice, now, model=world.model)
    reports.drive(report, now)
    training = a_trained_one(alice, world.track, now)
    TrainingJob.objects.filter(pk=training.pk).update(state="stopped", ended_at=now, ended_because="stopped")
    ended = {"state": SweepState.STOPPED, "ended_at": now}
    group, (kim,) = a_group(world.bob, 1, now)
    GroupMember.objects.create(group=group, racer=alice, asked_at=now, confirmed_at=now, confirmed_by=world.bob)
    task = an_assignment(group, now, shows="named")
    for racer in (alice, kim):
        hand_in(task, racer, now)
    return world, {
        "task": task.public_id,
        "training": training.public_id,
        "report": report.public_id,
        "sweep": a_sweep_row(alice, world.track, now, **ended).public_id,
    }


@pytest.mark.parametrize("path", PATHS)
def test_a_signed_in_page_needs_few_queries(busy: tuple[World, dict[str, str]], path: str) -> None:
    world, words = busy
    client = world.client("alice")
    filled = path
    for word, value in words.items():
        filled = filled.replace(f"{{{word}}}", value)
    at = address(world, filled)
    queries(client, at)
    sent = queries(client, at)
    assert len(sent) <= LIMIT + MORE.get(path, 0), "\n".join(sent)


def test_a_run_of_a_private_race_is_shared_with_nobody(world: World, shared: None) -> None:
    race = a_race(world.now, name="Ours", organiser=world.bob)
    run = drive(race, world.alice, laps(9_000, 9_100, 9_200), world.now).evaluation
    Race.objects.filter(pk=race.pk).update(visibility=Visibility.INVITATION)
    strangers = a_racer("stranger"), a_racer("another-stranger")
    for racer, status in ((world.bob, 200), (strangers[0], 404), (world.alice, 200), (strangers[1], 404)):
        client = Client()
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
        answer = client.get(run.get_absolute_url())
        assert answer.status_code == status
        assert status == 404 or (b"data-viewer" in answer.content and b"Ours" in answer.content)
    assert Client().get(run.get_absolute_url()).status_code == 404


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_two_racers_at_once_never_see_each_others_races() -> None:
    """Each has a private race that carol is in: her profile shows it to its racer alone, and so does theirs; a live
    event greets each by their own car, and a season marks each one's row."""
    now = timezone.now()
    a_track()
    carol, ann, ben = a_racer("carol"), a_racer("ann"), a_racer("ben")
    for racer in (ann, ben):
        race = a_race(now, name=f"Private of {racer.alias}", organiser=racer)
        drive(race, carol, laps(9_000, 9_100, 9_200), now)
        Race.objects.filter(pk=race.pk).update(visibility=Visibility.INVITATION)
    drive(a_race(now, name="For everybody"), carol, laps(9_000, 9_100, 9_200), now)
    show = a_live_race(now, carol, slug="show", name="Show")
    a_show(now, carol, ["ann", "ben"], race=show)
    for racer in (ann, ben):
        a_model(racer, name=f"Car of {racer.alias}")
    season = create_season(slug="year", name="Year", starts_on=now.date(), ends_on=(now + timedelta(days=300)).date())
    times = {"opens_at": now - timedelta(days=1), "closes_at": now + timedelta(days=9)}
    round_ = a_round(season, 1, Stage.OPEN, now=now - timedelta(days=2), **times)
    board(round_.race, [ann, ben, carol])
    strangers = [a_racer(f"stranger-{number}") for number in range(2)]

    def look(racer: Racer) -> set[str]:
        try:
            client = Client()
            client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
            seen = set()
            for _ in range(6):
                for path in PAGES_OF_TWO:
                    html = client.get(path).content.decode()
                    seen |= {name for name in NAMES if name in html}
                    seen |= {f"Row of {name}" for name in MY_ROW.findall(html)}
            return seen
        finally:
            connections.close_all()

    readers = [ann, ben, *strangers]
    with ThreadPoolExecutor(len(readers)) as threads:
        found = dict(zip([racer.alias for racer in readers], threads.map(look, readers), strict=True))
    assert found["ann"] == {"For everybody", "Private of ann", "Car of ann", "Row of ann"}
    assert found["ben"] == {"For everybody", "Private of ben", "Car of ben", "Row of ben"}
    assert found["stranger-0"] == found["stranger-1"] == {"For everybody"}
    assert not connection.in_atomic_block


PAGES_OF_TWO = (
    *(f"/racers/{alias}/" for alias in ("carol", "ann", "ben")),
    *("/races/show/event/", "/seasons/year/", "/seasons/year/standings/", "/runs/new/", "/models/", "/train/new/"),
)
MY_ROW = re.compile(r'<(?:tr|li)[^>]* class="[^"]*\bme".*?/racers/([\w-]+)/"', re.DOTALL)
NAMES = ("For everybody", "Private of ann", "Private of ben", "Car of ann", "Car of ben")
