"""Trainings through the API: begin, follow, stop; whose they are."""

from __future__ import annotations

import pytest

from tests.factories import a_track
from tests.training.jobs import REWARD, a_training
from training import tasks
from training.models import TrainingIteration, TrainingJob

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/trainings/"


@pytest.fixture(autouse=True)
def _installed(settings, monkeypatch):
    settings.TRAINING, settings.TRAINING_PAUSED = True, False
    monkeypatch.setattr(tasks.train, "apply_async", lambda **_options: None)
    monkeypatch.setattr("training.api.trainings.refusals", lambda *_: [])


def sent(**changes):
    return {"name": "first-car", "track": a_track().slug, "reward_code": REWARD} | changes


def test_a_training_begins_with_what_is_sent_and_usual_values(alice, as_racer):
    answer = as_racer(alice).post(ADDRESS, sent(hyperparameters={"lr": 0.0001}, stop_clean_laps=3))
    assert answer.status_code == 201, answer.data
    assert (answer.data["state"], answer.data["queue_position"], answer.data["track"]) == ("queued", 1, "oval")
    assert answer.data["hyperparameters"]["lr"] == 0.0001
    assert answer.data["hyperparameters"]["num_epochs"] == 4
    assert len(answer.data["action_space"]) == 5
    assert answer.data["iterations"] == []


def test_sac_gets_ranges_unless_told_otherwise(alice, as_racer):
    answer = as_racer(alice).post(ADDRESS, sent(algorithm="sac"))
    assert answer.data["action_space_type"] == "continuous"


@pytest.mark.parametrize(
    ("changes", "status", "code"),
    [
        ({"hyperparameters": {"lr": 1}}, 400, "training_hyperparameter"),
        ({"hyperparameters": {"magic": 1}}, 400, "training_hyperparameter_unknown"),
        ({"name": "no blanks"}, 400, "training_name_form"),
        ({"action_space": [{"steering_angle": 0, "speed": 1}]}, 400, "training_action_count"),
        ({"algorithm": "sac", "action_space_type": "discrete"}, 400, "training_sac_continuous"),
        ({"vehicle": "somebodys"}, 403, "vehicle_not_yours"),
        ({"clone_from": "somebodys"}, 403, "clone_not_yours"),
        ({"stop_minutes": 0}, 400, "invalid"),
        ({"track": "nowhere"}, 400, "invalid"),
    ],
)
def test_what_makes_no_training_is_refused_with_its_code(alice, as_racer, changes, status, code):
    answer = as_racer(alice).post(ADDRESS, sent(**changes))
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert not TrainingJob.objects.exists()


def test_a_second_one_of_the_same_name_and_a_closed_room_are_told(alice, as_racer, settings):
    client = as_racer(alice)
    client.post(ADDRESS, sent())
    assert client.post(ADDRESS, sent()).status_code == 409
    settings.TRAINING = False
    answer = client.post(ADDRESS, sent(name="other"))
    assert (answer.status_code, answer.data["code"]) == (503, "training_unavailable")


def test_a_training_is_its_owners_and_admins_see_it(alice, cast, now):
    job = a_training(alice, a_track(), now)
    TrainingIteration.objects.create(
        job=job, number=1, steps=2000, seconds=2.0, eval_progress=100.0, eval_reward=9.0, is_best=True
    )
    expected = {"owner": 200, "admin": 200, "member": 404, "stranger": 404, "anonymous": 401}
    for role, status in expected.items():
        assert cast[role].get(f"{ADDRESS}{job.public_id}/").status_code == status, role
        assert cast[role].get(f"{ADDRESS}{job.public_id}/metrics/").status_code == status, role
    read = cast["owner"].get(f"{ADDRESS}{job.public_id}/").data
    assert [(row["number"], row["is_best"]) for row in read["iterations"]] == [(1, True)]
    assert [len(cast[role].get(ADDRESS).data["results"]) for role in ("owner", "stranger", "admin")] == [1, 0, 0]
    for role in ("member", "stranger", "anonymous"):
        assert cast[role].post(f"{ADDRESS}{job.public_id}/stop/").status_code == expected[role], role
    assert cast["owner"].post(f"{ADDRESS}{job.public_id}/stop/").data["state"] == "stopped"
    assert cast["owner"].post(f"{ADDRESS}{job.public_id}/stop/").data["state"] == "stopped"
