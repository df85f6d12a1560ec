"""Sweeps through the API: begin, follow, stop, delete; whose they are."""

from __future__ import annotations

import pytest

from tests.factories import a_track
from tests.training.jobs import REWARD
from tests.training.test_sweeps import a_sweep
from training.models import Sweep, TrainingJob
from training.sweeps.services import stop_sweep

pytest.importorskip("optuna", reason="training is not installed: make training")
pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/sweeps/"
SEARCH = {"hyperparameters": {"lr": {"low": 0.0001, "high": 0.001}}}


@pytest.fixture(autouse=True)
def _installed(trainings_taken_on, monkeypatch):
    monkeypatch.setattr("training.jobs.api.trainings.refusals", lambda *_: [])
    monkeypatch.setattr("training.sweeps.api.refusals", lambda *_: [])


def sent(**changes):
    base = {"name": "tune", "track": a_track().slug, "reward_code": REWARD}
    return base | {"settings": 3, "budget_s": 60, "search": SEARCH} | changes


def test_a_sweep_begins_with_the_base_settings(alice, as_racer):
    search = SEARCH | {
        "action_spaces": [
            {
                "action_space_type": "continuous",
                "action_space": {
                    "steering_angle": {"low": -30, "high": 30},
                    "speed": {"low": 0.5, "high": 2},
                },
            }
        ],
        "reward_functions": [REWARD + "# another\r\n"],
    }
    answer = as_racer(alice).post(ADDRESS, sent(search=search, hyperparameters={"lr": 0.0005}))
    assert answer.status_code == 201, answer.data
    data = answer.data
    assert (data["state"], data["settings"], data["budget_s"], data["owner"]) == ("running", 3, 60, "alice")
    assert data["plan"] == [{"trials": 3, "seconds": 10.0}, {"trials": 1, "seconds": 30.0}]
    (trial,) = data["trials"]
    assert trial["setting"] == {"hyperparameters": {"lr": 0.0005}, "action_space": 0, "reward_function": 0}
    assert (trial["number"], trial["state"], trial["rung"], trial["progress"]) == (1, "queued", 1, None)
    assert data["space"]["reward_functions"] == [REWARD, REWARD + "# another\n"]
    assert (data["importances"], data["best_model"], data["stop_asked"]) == ([], None, False)
    client = as_racer(alice)
    assert client.get(f"/api/v1/trainings/{trial['training']}/").status_code == 200
    assert client.get(f"{ADDRESS}{data['public_id']}/").data == data
    (listed,) = client.get(ADDRESS).data["results"]
    assert listed["public_id"] == data["public_id"]


@pytest.mark.parametrize(
    ("changes", "status", "code"),
    [
        ({"settings": 1}, 400, "invalid"),
        ({"settings": 13}, 400, "invalid"),
        ({"settings": "many"}, 400, "invalid"),
        ({"budget_s": 0}, 400, "invalid"),
        ({"budget_s": 10}, 400, "sweep_budget"),
        ({"budget_s": 10**9}, 400, "sweep_budget"),
        ({"search": {}}, 400, "sweep_space_empty"),
        ({"search": {"hyperparameters": {"lr": {"low": 1, "high": 0}}}}, 400, "training_hyperparameter"),
        ({"search": {"hyperparameters": {"lr": 1}}}, 400, "invalid"),
        ({"search": {"hyperparameters": {"magic": {"low": 1, "high": 2}}}}, 400, "training_hyperparameter_unknown"),
        (
            {"search": {"action_spaces": [{"action_space_type": "discrete", "action_space": 3}]}},
            400,
            "training_action_space",
        ),
        ({"search": {"action_spaces": [{}]}}, 400, "invalid"),
        ({"search": {"reward_functions": [""]}}, 400, "invalid"),
        ({"search": {"magic": 1}}, 400, "invalid"),
        ({"search": 3}, 400, "invalid"),
        ({"settings": 3, "search": {"reward_functions": ["another"]}}, 400, "sweep_combinations"),
        ({"name": "no blanks"}, 400, "sweep_name_form"),
        ({"stop_minutes": 5}, 400, "invalid"),
        ({"vehicle": "somebodys"}, 403, "vehicle_not_yours"),
    ],
)
def test_an_invalid_sweep_is_refused_with_its_code(alice, as_racer, changes, status, code):
    answer = as_racer(alice).post(ADDRESS, sent(**changes))
    assert (answer.status_code, answer.data["code"]) == (status, code), answer.data
    assert not Sweep.objects.exists() and not TrainingJob.objects.exists()


@pytest.mark.parametrize("missing", ["settings", "budget_s", "search"])
def test_each_part_is_needed(alice, as_racer, missing):
    body = sent()
    del body[missing]
    assert as_racer(alice).post(ADDRESS, body).status_code == 400


def test_a_sweep_needs_training(alice, as_racer, settings):
    settings.TRAINING = False
    answer = as_racer(alice).post(ADDRESS, sent())
    assert (answer.status_code, answer.data["code"]) == (503, "training_unavailable")


def test_only_the_owner_and_admins_see_and_stop_a_sweep(alice, cast, now):
    sweep = a_sweep(alice, a_track(), now)
    page = f"{ADDRESS}{sweep.public_id}/"
    for role, status in {"owner": 200, "admin": 200, "member": 404, "stranger": 404, "anonymous": 401}.items():
        assert cast[role].get(page).status_code == status, role
    for role, status in {"member": 404, "stranger": 404, "anonymous": 401}.items():
        assert cast[role].post(f"{page}stop/").status_code == status, role
        assert cast[role].delete(page).status_code == status, role
    assert cast["owner"].delete(page).data["code"] == "sweep_running"
    assert cast["admin"].post(f"{page}stop/").data["state"] == "stopped"
    assert cast["admin"].delete(page).status_code == 404
    assert cast["owner"].delete(page).status_code == 204
    assert not Sweep.objects.exists()


def test_a_trials_training_is_not_deleted_alone(alice, as_racer, now):
    sweep = a_sweep(alice, a_track(), now)
    stop_sweep(sweep=sweep, by=alice, now=now)
    client = as_racer(alice)
    job = sweep.trials.get().job
    answer = client.delete(f"/api/v1/trainings/{job.public_id}/")
    assert (answer.status_code, answer.data["code"]) == (409, "training_of_sweep")
    assert client.get("/api/v1/trainings/").data["results"] == []
