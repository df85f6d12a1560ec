"""The rewards along a run of a training's model: by its function, in the sandbox, for those who may see it."""

from __future__ import annotations

import csv
import io
import json
from html import unescape

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.training.jobs import a_training
from training.jobs import run_rewards
from training.models import TrainingJob

pytestmark = pytest.mark.django_db
CODE = "def reward_function(params):\n    return params['progress'] + 1000 * params['distance_from_center']\n"


@pytest.fixture
def run():
    now, alice = timezone.now(), a_racer("alice")
    race = a_race(now)
    driven = a_driven_run(race, alice, now, lap_ms=2_000)
    job = a_training(alice, race.track, now, reward_code=CODE)
    TrainingJob.objects.filter(pk=job.pk).update(best_model=driven.model)
    return driven


def reader(alias: str, **fields) -> Client:
    client = Client()
    client.force_login(a_racer(alias, **fields))
    return client


def owner(run) -> Client:
    client = Client()
    client.force_login(run.owner)
    return client


def rewards(client, run, **query):
    answer = client.get(reverse("telemetry", args=[run.public_id]), {"reward": "1", **query})
    assert answer.status_code == 200, answer.content
    return answer.json()["runs"][0]["reward"]


@pytest.mark.slow
def test_the_function_of_the_training_rewards_the_lap(run):
    found = rewards(owner(run), run, lap=2)
    # on the centre line the reward is the progress, which rises from the first driven step on
    known = [each for each in found if each is not None]
    assert len(known) > 0.9 * len(found)
    assert known == pytest.approx(sorted(known), abs=1.0)
    assert known[0] < 10.0 and known[-1] > 85.0
    assert rewards(owner(run), run, reward="", lap=2) is None, "only where they are asked for"
    sheet = owner(run).get(reverse("telemetry_csv", args=[run.public_id]), {"reward": "1", "lap": 2}).content.decode()
    assert [row["reward"] for row in csv.DictReader(io.StringIO(sheet))][-1] == str(known[-1])
    api = owner(run).get(f"/api/v1/evaluations/{run.public_id}/telemetry/", {"reward": "1", "lap": 2})
    assert api.json()["runs"][0]["reward"] == found


@pytest.mark.slow
def test_rewards_are_for_those_who_see_the_training(run):
    assert rewards(Client(), run) is None
    assert rewards(reader("bob"), run) is None
    assert rewards(reader("boss", is_staff=True), run) is not None
    page = reverse("replay", args=[run.public_id])

    def setup(client) -> dict:
        html = client.get(page, {"analysis": "part"}).content.decode()
        found = json.loads(unescape(html.partition('data-telemetry="')[2].partition('"')[0]))
        assert found["rewarded"] is ("&amp;reward=1" in html), "the file has them too"
        return found

    assert [setup(client)["rewarded"] for client in (owner(run), reader("carol"), Client())] == [True, False, False]
    TrainingJob.objects.update(best_model=None)
    assert rewards(owner(run), run) is None


@pytest.mark.slow
def test_rewards_are_computed_once(run, monkeypatch):
    asked = []
    real = run_rewards._rewards
    monkeypatch.setattr(run_rewards, "_rewards", lambda *given: asked.append(given) or real(*given))
    assert rewards(owner(run), run) == rewards(owner(run), run)
    assert len(asked) == 1
    TrainingJob.objects.update(reward_code="def reward_function(params):\n    return 7.0\n")
    assert set(rewards(owner(run), run)) <= {7.0, None} and len(asked) == 2, "another function, other rewards"


@pytest.mark.slow
def test_a_function_that_fails_is_named_and_the_rest_is_read_without_it(run):
    TrainingJob.objects.update(reward_code="def reward_function(params):\n    return params['nothing']\n")
    answer = owner(run).get(reverse("telemetry", args=[run.public_id]), {"reward": "1"})
    assert (answer.status_code, answer.json()["code"]) == (400, "reward_raised")
    assert answer.json()["detail"]
    assert rewards(owner(run), run, reward="0") is None


def test_runs_with_other_cars_and_of_other_models_have_none(run):
    assert run_rewards.rewards_of_runs([run], run.owner)
    run.spec["rules"]["race_type"] = "head_to_head"
    assert run_rewards.rewards_of_runs([run], run.owner) == {}
    other = a_driven_run(a_race(timezone.now()), run.owner, timezone.now())
    assert run_rewards.rewards_of_runs([other], run.owner) == {}
