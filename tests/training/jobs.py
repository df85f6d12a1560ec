"""Trainings for tests: taken on by the real service, run by the real trainer."""

from __future__ import annotations

import gzip
import json
from functools import lru_cache
from typing import Any

import numpy as np
from django.core.files.base import ContentFile

from paddock.rules.training import taken_from
from tests.factories import a_model
from training.jobs.services.creation import create_training
from training.jobs.settings_checks import DEFAULT_ACTIONS
from training.models import JobState, Sweep, SweepTrial, TrainingIteration, TrainingJob
from training.trainer.client import Iteration
from training.trainer.network import NetworkLayout, to_onnx

GOOD = {
    "number": 1,
    "steps": 100,
    "seconds": 1.0,
    "steps_per_second": 100.0,
    "episodes": [{"episode": 0, "reward": 1.0, "progress": 5.0, "status": "Off track", "steps": 9, "time_ms": 600}],
    "mean_reward": 1.0,
    "mean_progress": 5.0,
    "eval_trials": [
        {"reward": 1.0, "progress": 5.0, "status": "Off track", "steps": 9, "time_ms": 600, "lap_ms": None}
    ],
    "eval_progress": 5.0,
    "eval_reward": 1.0,
    "eval_lap_ms": None,
    "eval_clean_laps": 0,
    "entropy": 1.6,
    "policy_loss": 0.0,
    "value_loss": 1.0,
    "is_best": True,
    "confirmed": False,
}

REWARD = '''
def reward_function(params):
    """Follow the centre line."""
    width, distance = params["track_width"], params["distance_from_center"]
    for share, reward in ((0.1, 1.0), (0.25, 0.5), (0.5, 0.1)):
        if distance <= share * width:
            return reward
    return 1e-3
'''


# as short as a training that learns can be
SHORT_TRAINING = {
    "hyperparameters": {"num_episodes_between_training": 5, "batch_size": 128, "num_epochs": 3},
    "trials": 1,
    "stop_steps": 1500,
}


def a_training(owner, track, now, **changes: Any) -> TrainingJob:
    """A training on ``track`` with the wizard's defaults."""
    asked = {
        "name": "first",
        "reward_code": REWARD,
        "action_space_type": "discrete",
        "action_space": [dict(action) for action in DEFAULT_ACTIONS],
        "seed": 0,
    }
    settings, rest = taken_from(asked | changes)
    return create_training(owner=owner, track=track, settings=settings, now=now, **rest)


def a_sweep_row(owner, track, now, **values) -> Sweep:
    """A sweep of two learning rates whose first trial waits, or is stopped where the sweep is over; nothing is checked,
    and Optuna is not needed."""
    space = {"hyperparameters": {"lr": {"low": 1e-4, "high": 1e-3}}, "action_spaces": [{}], "reward_functions": [""]}
    sweep = Sweep.objects.create(
        **{"owner": owner, "name": "tune", "space": space, "settings_count": 2, "budget_s": 60, "created_at": now}
        | values
    )
    job = a_training(owner, track, now, name=f"{sweep.name}-1")
    over = {}
    if sweep.is_final:
        over = {"state": JobState.STOPPED, "ended_because": "stopped", "ended_at": sweep.ended_at}
    TrainingJob.objects.filter(pk=job.pk).update(stop_seconds=15.0, keeps_models=False, **over)
    setting = {"hyperparameters": {"lr": 1e-3}, "action_space": 0, "reward_function": 0}
    SweepTrial.objects.create(sweep=sweep, number=1, setting=setting, job=job)
    return sweep


def network(job, seed: int) -> bytes:
    """A network that the gate admits, with weights of its own."""
    return _network(json.dumps(job.metadata), seed)


@lru_cache(maxsize=32)
def _network(metadata: str, seed: int) -> bytes:
    layout, rng = NetworkLayout.of(json.loads(metadata)), np.random.default_rng(seed)
    return to_onnx(layout, {name: rng.normal(0, 0.1, shape) for name, shape in layout.shapes.items()}, squash=False)


def an_iteration(number: int, **changes) -> Iteration:
    values = {name: value for name, value in GOOD.items() if name != "confirmed"}
    return Iteration(
        values | {"number": number, "steps": 100 * number} | changes, [[0.0, 0.0, 0.0, 1.0]], b"onnx", b"gz"
    )


def a_trained_one(owner, track, now) -> TrainingJob:
    """A training that has a best and a last model and has written its files."""
    job = a_training(owner, track, now)
    models = {"best_model": a_model(owner), "last_model": a_model(owner)}
    TrainingJob.objects.filter(pk=job.pk).update(log="learned\n", **models)
    job.refresh_from_db()
    job.sb3_zip.save("first.zip", ContentFile(b"PK-sb3"))
    row = TrainingIteration(job=job, number=3, steps=2000, seconds=2.0, eval_progress=100.0, eval_reward=9.0)
    row.simtrace.save("3.csv.gz", ContentFile(gzip.compress(b"episode,steps\n0,1\n")), save=False)
    row.save()
    return job
