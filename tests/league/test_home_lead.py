"""What the first page leads with: the leading lap, what the reader can do next, recent results."""

from __future__ import annotations

import json
from datetime import timedelta
from html import unescape
from uuid import uuid4

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from evaluation.models import Evaluation
from league.home.selectors import NEWCOMER_FOR
from races.models import Entry, Race, Visibility
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer, drive, laps
from tests.training.jobs import a_training
from training.models import TrainingJob

pytestmark = pytest.mark.django_db


@pytest.fixture
def now(wakes):
    return timezone.now()


@pytest.fixture
def race(now) -> Race:
    return a_race(now, name="Busy night")


def page(racer=None, **query) -> str:
    client = Client()
    if racer is not None:
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client.get("/", query).content.decode()


def stage(html: str) -> str:
    return html.partition('id="home-stage"')[2].partition('<div class="stack">')[0]


def results(html: str) -> str:
    return html.partition('id="recent-results"')[2].partition("</section>")[0]


def long_there(alias: str):
    """A racer who is no newcomer."""
    return a_racer(alias, joined_at=timezone.now() - NEWCOMER_FOR - timedelta(days=1))


def test_the_page_leads_with_the_best_lap_of_the_leader(race, now):
    a_driven_run(race, a_racer("slow"), now, lap_ms=22_000)
    run = a_driven_run(race, a_racer("fast"), now, lap_ms=20_000)
    shown = stage(page())
    assert "Leading lap" in shown and "fast" in shown and "slow" not in shown
    assert "0:19.999" in shown and run.public_id in shown and "track-line" in shown


def test_a_house_car_leads_until_a_racer_is_classified(race, now):
    a_driven_run(race, a_racer("Steady", is_house=True), now, lap_ms=1_000)
    html = page()
    assert "House car" in stage(html) and "Steady" in stage(html)
    assert "House cars to beat:" in html and "0 racers" not in html
    a_driven_run(race, a_racer("fast"), now, lap_ms=1_200)
    assert "fast" in stage(page()) and "Steady" not in stage(page())


def test_an_open_race_without_a_lap_shows_its_map(race):
    shown = stage(page())
    assert "Busy night" in shown and "track-road" in shown and "track-line" not in shown
    assert not stage(page()).count("Leading lap")


def test_a_sealed_run_is_not_played(race, now):
    run = a_driven_run(race, a_racer("fast"), now)
    Evaluation.objects.filter(pk=run.pk).update(sealed=True)
    assert run.public_id not in stage(page()) and "track-line" not in stage(page())


def test_nothing_of_a_hidden_race_or_a_race_by_invitation_is_shown(race, now):
    a_driven_run(race, a_racer("fast"), now)
    hidden = page(spoilers="hide")
    assert "fast" not in stage(hidden) and "0:00.999" not in hidden and results(hidden) == ""
    Race.objects.filter(pk=race.pk).update(visibility=Visibility.INVITATION)
    for reader in (None, a_racer("stranger")):
        assert "fast" not in page(reader) and "Busy night" not in page(reader)


def test_recent_results_are_of_racers_and_the_latest_first(race, now):
    for number, alias in enumerate(("first", "second", "third")):
        drive(race, a_racer(alias), laps(*[11_000 - number] * 3), now)
    drive(race, a_racer("Steady", is_house=True), laps(9_000, 9_000, 9_000), now)
    listed = results(page())
    assert listed.index("third") < listed.index("second") < listed.index("first")
    assert "Steady" not in listed and "0:10.998" in listed


def test_a_racer_sees_how_much_gains_a_place(race, now):
    mine, leader = long_there("mine"), a_racer("leader")
    drive(race, leader, laps(10_000, 10_000, 10_000), now)
    assert "No result in an open race yet" in page(mine)
    drive(race, mine, laps(10_410, 10_410, 10_410), now)
    assert "0.410 s to gain a place" in page(mine)
    assert "You lead." in page(leader) and "to gain a place" not in page(leader)
    assert "What next" not in page()


def test_more_places_and_results_need_no_more_queries(race, now, django_assert_max_num_queries):
    mine = long_there("mine")
    drive(race, mine, laps(10_000, 10_000, 10_000), now)
    client = Client()
    client.force_login(mine, backend="django.contrib.auth.backends.ModelBackend")
    client.get("/")
    with CaptureQueriesContext(connection) as before:
        client.get("/")
    for number in range(3):
        other = a_race(now, name=f"Night {number}")
        drive(other, mine, laps(10_000, 10_000, 10_000), now)
        drive(other, a_racer(), laps(9_000, 9_000, 9_000), now)
    assert Entry.objects.filter(racer=mine).count() == 4
    with django_assert_max_num_queries(len(before)):
        client.get("/")


def test_a_running_training_leads_where_no_lap_does(race, now):
    alice, bob = a_racer("alice"), a_racer("bob")
    job = a_training(alice, race.track, now, name="night-shift")
    assert "Training now" not in page(alice), "it waits"
    drive_rows = [[0.1 * step, 0.0, 0.0, 1.0] for step in range(20)]
    running = {"state": "running", "lease": uuid4(), "leased_until": now, "started_at": now, "driving": drive_rows}
    TrainingJob.objects.filter(pk=job.pk).update(attempt=1, **running)
    led = stage(page(alice))
    assert "Training now" in led and "night-shift" in led and job.get_absolute_url() in led
    setup = json.loads(unescape(led.partition('data-viewer="')[2].partition('"')[0]))
    columns = setup["runs"][0]["document"]["columns"]
    assert setup["quiet"] and columns["x"][10] == 1.0 and columns["t"][15] == 1_000
    assert {len(column) for column in columns.values()} == {20}
    for reader in (bob, None):
        assert "night-shift" not in page(reader) and "Be first on the board." in stage(page(reader))
    a_driven_run(race, bob, now)
    assert "night-shift" not in page(alice) and "Leading lap" in stage(page(alice))
