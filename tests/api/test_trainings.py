"""Trainings through the API: begin, follow, stop; whose they are."""

from __future__ import annotations

import json
import time
from datetime import timedelta

import pytest
from django.utils import timezone

from tests.factories import a_race, a_track
from tests.training.jobs import REWARD, a_training
from training.models import RewardSignature, TrainingIteration, TrainingJob
from training.rewards.sandbox.function import POSITIONAL_NAMES

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/trainings/"


@pytest.fixture(autouse=True)
def _installed(trainings_taken_on, monkeypatch):
    monkeypatch.setattr("training.jobs.api.trainings.refusals", lambda *_: [])


def sent(**changes):
    return {"name": "first-car", "track": a_track().slug, "reward_code": REWARD} | changes


def test_a_training_takes_what_is_sent_and_defaults(alice, as_racer):
    answer = as_racer(alice).post(ADDRESS, sent(hyperparameters={"lr": 0.0001}, stop_clean_laps=3))
    assert answer.status_code == 201, answer.data
    assert (answer.data["state"], answer.data["queue_position"], answer.data["track"]) == ("queued", 1, "oval")
    assert answer.data["hyperparameters"]["lr"] == 0.0001
    assert answer.data["hyperparameters"]["num_epochs"] == 4
    assert len(answer.data["action_space"]) == 5
    assert answer.data["iterations"] == []


def test_sac_has_a_continuous_action_space_by_default(alice, as_racer):
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
def test_an_invalid_training_is_refused_with_its_code(alice, as_racer, changes, status, code):
    answer = as_racer(alice).post(ADDRESS, sent(**changes))
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert not TrainingJob.objects.exists()


NONSENSE = [
    *(
        {"boxes": boxes}
        for boxes in ([1], [[]], [{}], [{"fraction": "x", "lane": "inner"}], [{"fraction": 0.5}], "x", {})
    ),
    {"boxes": [{"fraction": 1e400, "lane": "inner"}], "race_type": "object_avoidance"},
    {"boxes": [{"fraction": 0.5, "lane": ["inner"]}], "race_type": "object_avoidance"},
    {"boxes": [{"fraction": 0.5, "lane": "inner", "more": 1}], "race_type": "object_avoidance"},
    {"boxes": [{"fraction": 0.5, "lane": "inner"}] * 10, "race_type": "object_avoidance"},
    {"boxes": [{"fraction": 0.5, "lane": "inner"}], "random_boxes": 3, "race_type": "object_avoidance"},
    {"boxes": [{"fraction": 0.5, "lane": "inner"}]},
    {"random_boxes": 3},
    {"bots": 3},
    {"bots": 3, "random_boxes": 3, "race_type": "head_to_head"},
    {"bots": 6, "bot_speed_mps": "fast", "race_type": "head_to_head"},
    {"race_type": "object_avoidance", "bots": 2, "random_boxes": 2},
    *(
        {"action_space": space}
        for space in (None, 1, "x", {}, {"speed": 1}, [[]], [{"speed": "1", "steering_angle": 1}] * 3)
    ),
    {"action_space": [{"speed": 1.0, "steering_angle": {"a": 1}}] * 3},
    {"action_space": [{"speed": 1.0, "steering_angle": True}] * 3},
    {"action_space_type": "continuous", "action_space": {"speed": [1, 2], "steering_angle": [1, 2]}},
    {"action_space_type": "continuous", "action_space": {"speed": {"low": None, "high": 2}, "steering_angle": 3}},
    *(
        {"hyperparameters": values}
        for values in ([], "x", {"lr": []}, {"batch_size": "64"}, {"loss_type": 3}, {"lr": None})
    ),
    *({"name": name} for name in ("a\x00b", "\ud800", ["x"], {"a": 1}, "x" * 65, "é", "")),
    *({"description": text} for text in ("\x00", "\ud800", "x" * 256, [1])),
    *({"reward_code": text} for text in ("\x00", "\ud800", "x" * 140_001, "", " ", [1], None)),
    *({field: value} for field in ("trials", "stop_steps", "seed") for value in (-1, 2**31, 1.5, "x", [], 10**30)),
    *({"clone_from": value} for value in ("\x00", "\ud800", [], "x" * 13)),
    *({"vehicle": value} for value in ("\x00", "\ud800", [], "x" * 13)),
    *({"submit_to_race": value} for value in ("\x00", "\ud800", [], "nowhere")),
    *({"track": value} for value in ("\x00", "\ud800", [], None)),
    *({"direction": "up"}, {"race_type": []}, {"algorithm": {}}, {"best_metric": 1}),
]


@pytest.mark.parametrize("changes", NONSENSE, ids=lambda changes: ascii(changes)[:60])
def test_malformed_input_is_refused_with_a_code(alice, as_racer, changes):
    answer = as_racer(alice).post(ADDRESS, json.dumps(sent(**changes)), content_type="application/json")
    assert 400 <= answer.status_code < 500, answer.data
    assert answer.data["code"]
    assert not TrainingJob.objects.exists()


@pytest.mark.parametrize("body", ["", "[]", "3", "null", '{"name":', '{"a":' * 5000, "\x00"])
def test_a_malformed_body_is_refused(alice, as_racer, body):
    answer = as_racer(alice).post(ADDRESS, body, content_type="application/json")
    assert 400 <= answer.status_code < 500


def test_a_target_race_that_accepts_no_cars_is_refused(alice, as_racer):
    race = a_race(timezone.now() - timedelta(days=60), track=a_track())
    answer = as_racer(alice).post(ADDRESS, sent(submit_to_race=race.slug))
    assert (answer.status_code, answer.data["code"]) == (409, "race_closed")
    assert not TrainingJob.objects.exists()


def test_the_site_itself_never_parses_reward_code():
    """The parser needs ten seconds for this one, and other texts bring it to fall: only the sandbox can bear that."""
    began = time.process_time()
    assert RewardSignature.of("def reward_function(params):\n    return f'" + "{x}" * 40_000 + "'\n") == "params"
    assert RewardSignature.of("def reward_function(" * 7_000) == "params"
    assert time.process_time() - began < 1.0
    first = ", ".join(POSITIONAL_NAMES)
    assert RewardSignature.of(f"import math\n\ndef reward_function({first}):\n    return 1.0\n") == "positional"
    assert RewardSignature.of(f"def reward_function(self, {first}):\n    return 1.0\n") == "positional"
    assert RewardSignature.of("def reward_function(params: dict[str, float]) -> float:\n    return 1.0\n") == "params"


def test_a_taken_name_and_disabled_training_are_reported(alice, as_racer, settings):
    client = as_racer(alice)
    client.post(ADDRESS, sent())
    assert client.post(ADDRESS, sent()).status_code == 409
    settings.TRAINING = False
    answer = client.post(ADDRESS, sent(name="other"))
    assert (answer.status_code, answer.data["code"]) == (503, "training_unavailable")


def test_only_the_owner_and_admins_see_a_training(alice, cast, now):
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
    stopped = cast["owner"].post(f"{ADDRESS}{job.public_id}/stop/").data
    assert (stopped["state"], stopped["ended_because"], stopped["ending"]) == (
        "stopped",
        "stopped",
        "Stopped by you before it started",
    )
    assert cast["owner"].post(f"{ADDRESS}{job.public_id}/stop/").data["state"] == "stopped"
