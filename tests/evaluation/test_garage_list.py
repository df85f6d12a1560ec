"""The garage as a list: found, sorted, and with what each car did last."""

from __future__ import annotations

from datetime import timedelta

import pytest

from evaluation.garage.selectors import GarageSort, algorithm_of, garage_of, with_last_runs
from evaluation.garage.services import share_model
from evaluation.models import State, TrainedModel
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_track, drive, lap

pytestmark = pytest.mark.django_db


@pytest.fixture
def garage(alice, now):
    """Three models: the oldest was driven, the second waits, the newest never drove."""
    sac = {"training_algorithm": "sac"}
    names = [("Comet", 0, {}), ("Arrow", 1, sac), ("Bolt", 2, {})]
    models = {}
    for name, hours, metadata in names:
        model = a_model(alice, name=name)
        TrainedModel.objects.filter(pk=model.pk).update(
            created_at=now + timedelta(hours=hours),
            description=f"No. {hours}",
            metadata={**model.metadata, **metadata},
        )
        models[name] = model
    return models


def names(racer, **asked):
    return [model.name for model in garage_of(racer, **asked)]


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ({}, ["Bolt", "Arrow", "Comet"]),
        ({"sort": "name"}, ["Arrow", "Bolt", "Comet"]),
        ({"sort": "algorithm"}, ["Bolt", "Comet", "Arrow"]),
        ({"sort": "nonsense"}, ["Bolt", "Arrow", "Comet"]),
        ({"search": "olt"}, ["Bolt"]),
        ({"search": "no. 1"}, ["Arrow"]),
        ({"search": "ppo", "sort": "name"}, ["Bolt", "Comet"]),
        ({"search": "SAC"}, ["Arrow"]),
        ({"search": "100%"}, []),
    ],
)
def test_it_is_searched_and_sorted(alice, garage, asked, found):
    assert names(alice, **asked) == found


@pytest.mark.parametrize("sort", GarageSort.values)
def test_nobody_sees_anothers_garage(alice, bob, garage, sort):
    assert names(bob, sort=sort) == [] and len(names(alice, sort=sort)) == 3


def test_each_car_shows_its_last_run_and_nobody_elses(alice, bob, garage, now, django_assert_num_queries):
    race = a_race(now)
    raced = drive(race, alice, [lap(1, 9000), lap(2, 8500), lap(3, 8700)], now)
    waits = drive_own(owner=alice, model=garage["Arrow"], track=a_track(), now=now).evaluation
    share_model(model=garage["Bolt"], now=now)
    garage["Bolt"].refresh_from_db()
    drive_own(owner=bob, model=garage["Bolt"], track=a_track(), now=now)
    with django_assert_num_queries(2):
        shown = {model.name: model.last_run for model in with_last_runs(garage_of(alice, sort="driven"))}
        figures = [(run.state, run.track.name, getattr(run, "result", None)) for run in shown.values() if run]
    assert {State.FINISHED, State.QUEUED} == {figure[0] for figure in figures}
    assert shown[raced.evaluation.model.name].result.best_lap_ms == 8500
    assert shown["Arrow"] == waits and not hasattr(shown["Arrow"], "result")
    assert shown["Bolt"] is None and shown["Comet"] is None


@pytest.mark.parametrize(
    ("metadata", "word"),
    [({"training_algorithm": "clipped_ppo"}, "PPO"), ({"training_algorithm": "dqn"}, "dqn"), ({}, "")],
)
def test_an_algorithm_is_named_as_people_say_it(metadata, word):
    assert algorithm_of(metadata) == word


def test_the_page_says_what_each_car_did(alice, garage, now, client):
    drive(a_race(now), alice, [lap(1, 9000), lap(2, 8500), lap(3, 8700)], now)
    client.force_login(alice)
    page = client.get("/models/").content.decode()
    assert "0:08.500" in page and "no runs yet" in page and "SAC" in page
    assert "No matching models." in client.get("/models/?q=zebra").content.decode()
    assert client.get("/models/?q=%00&sort=%27").status_code == 200
