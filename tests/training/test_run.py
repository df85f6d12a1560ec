"""Real trainings in the sandbox: they learn, end in good order whatever happens, and leave what they promise."""

from __future__ import annotations

import io
import json
import math
import os
import signal
import subprocess
import sys
import threading
import zipfile
from datetime import timedelta
from time import monotonic, sleep

import numpy as np
import pandas
import pytest
from django.core.files.storage import default_storage
from django.db import connections
from django.utils import timezone

from evaluation.garage.admission import admit
from evaluation.models import TrainedModel
from paddock.packages.read import UploadPart
from paddock.simulator.trace import COLUMNS
from races.models import Submission
from tests.community import community
from tests.evaluation.processes import environment
from tests.factories import a_race
from tests.shared import CHECKOUT
from tests.training.jobs import REWARD, a_training
from training.jobs.exports import logs_zip, simtrace, training_metrics
from training.jobs.services.queue import TRAININGS, stop_training
from training.jobs.services.worker import run_next_training
from training.jobs.settings_checks import DEFAULT_BOUNDS
from training.models import Checkpoint, JobState, TrainingJob, Vehicle
from training.trainer.network import NetworkLayout, from_onnx

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.usefixtures("training_wakes", "wakes"),
    pytest.mark.xdist_group("training"),
]
SHORT = {"hyperparameters": {"num_episodes_between_training": 5, "batch_size": 128, "num_epochs": 3}, "trials": 1}


def run(job: TrainingJob) -> TrainingJob:
    assert run_next_training(worker="tester")
    job.refresh_from_db()
    return job


def test_a_training_laps_the_oval_and_leaves_its_files(alice, oval, now, tmp_path):
    race = a_race(now=timezone.now(), track=oval)
    job = run(a_training(alice, oval, timezone.now(), stop_clean_laps=3, stop_minutes=5, submit_to_race=race))
    assert (job.state, job.reason, job.operator_detail) == (JobState.FINISHED, "", "")
    assert job.best_model.name == "first"
    assert job.best_model.metadata["action_space"] == job.action_space
    assert (job.ended_because, job.steps_done > 0) == ("clean_laps", True)
    last = job.iterations.last()
    assert (last.eval_progress, last.eval_clean_laps, last.is_best) == (100.0, 3, True)
    assert 5_000 < last.eval_lap_ms < 30_000
    assert [one.is_best for one in job.iterations.all()].count(True) == 1
    assert len(job.driving) > 50 and all(len(place) == 4 for place in job.driving)
    assert job.submission == Submission.objects.get()
    assert job.submission.evaluation.model == job.best_model
    assert not Checkpoint.objects.exists()
    assert not [name for name in default_storage.listdir(f"training/{job.public_id}")[1] if "checkpoint" in name]
    assert "the best so far" in job.log

    trace = pandas.read_csv(io.BytesIO(simtrace(job.iterations.first())))
    assert tuple(trace.columns) == COLUMNS
    assert trace["reward"].max() == 1.0
    metrics = training_metrics(job)
    assert {one["phase"] for one in metrics["metrics"]} == {"training", "evaluation"}
    assert metrics["best_model_metric"] == "progress"
    with zipfile.ZipFile(io.BytesIO(b"".join(logs_zip(job)))) as archive:
        assert json.loads(archive.read("metrics/training/training-metrics.json")) == metrics
        assert archive.read("reward_function.py").decode() == REWARD
        archive.extractall(tmp_path)
    traces = community().DeepRacerLog(str(tmp_path))  # the community's own reader
    traces.load_training_trace()
    assert sorted(traces.df["iteration"].unique()) == list(range(job.iterations.count()))
    assert traces.df["episode"].nunique() > 5
    whole = community().DeepRacerLog(str(tmp_path))
    whole.load()
    assert len(whole.df) == len(traces.df)
    assert whole.hyperparameters() == job.hyperparameters

    from stable_baselines3 import PPO

    with job.sb3_zip.open("rb") as file:
        handed_out = file.read()
    learner = PPO.load(io.BytesIO(handed_out))
    assert learner.num_timesteps == job.steps_done
    uploaded = admit([UploadPart("first-sb3.zip", io.BytesIO(handed_out))])
    assert uploaded.sha256 == job.last_model.network_id, "uploaded as it is, it is the very model"

    still = {"trials": 1, "hyperparameters": SHORT["hyperparameters"] | {"lr": 1e-8}}  # no great step
    clone = run(a_training(alice, oval, now, name="clone", clone_from=job.best_model, stop_steps=1, **still))
    assert clone.state == JobState.FINISHED
    assert clone.iterations.first().eval_progress > 50.0, "it begins with what the other has learned"


def test_the_same_seed_makes_the_same_weights(alice, oval, now):
    first = run(a_training(alice, oval, now, stop_steps=1, **SHORT))
    kept = (first.best_model_id, first.last_model_id)
    TrainedModel.objects.filter(owner=alice).update(name="renamed", deleted_at=None)
    second = run(a_training(alice, oval, now, name="second", stop_steps=1, **SHORT))
    assert (second.best_model_id, second.last_model_id) == kept, "the same network is the same model of the garage"
    other = run(a_training(alice, oval, now, name="third", stop_steps=1, **SHORT | {"seed": 1}))
    assert other.last_model_id not in kept


def test_sac_learns_with_two_sensors(alice, oval, now):
    vehicle = Vehicle.objects.create(owner=alice, name="Both", sensors=["STEREO_CAMERAS", "SECTOR_LIDAR"])
    job = run(
        a_training(
            alice,
            oval,
            now,
            vehicle=vehicle,
            algorithm="sac",
            action_space_type="continuous",
            action_space=DEFAULT_BOUNDS,
            race_type="object_avoidance",
            random_boxes=2,
            stop_steps=1000,
            trials=1,
            hyperparameters={"num_episodes_between_training": 5, "batch_size": 64},
        )
    )
    assert (job.state, job.operator_detail) == (JobState.FINISHED, "")
    assert job.best_model.metadata["training_algorithm"] == "sac"
    assert all(one.value_loss is not None for one in job.iterations.all())


@pytest.mark.parametrize("algorithm", ["ppo", pytest.param("sac", marks=pytest.mark.soak)])
def test_every_step_up_to_the_limit_is_learned_from(alice, oval, now, algorithm):
    """An update is due every 512 steps: the limit cuts the second batch short, which is learned from all the same."""
    space = {"action_space_type": "continuous", "action_space": DEFAULT_BOUNDS} if algorithm == "sac" else {}
    short = {"num_episodes_between_training": 5, "batch_size": 64, "num_epochs": 3}
    job = run(
        a_training(
            alice,
            oval,
            now,
            algorithm=algorithm,
            hyperparameters=short,
            stop_steps=800,
            trials=1,
            stop_minutes=5,
            **space,
        )
    )
    assert (job.state, job.ended_because, job.reason) == (JobState.FINISHED, "steps", "")
    learned = [(one.steps, one.policy_loss is not None) for one in job.iterations.order_by("number")]
    assert learned == [(512, True), (800, True)]
    assert job.steps_done == 800
    assert 0.0 < job.reward_ms < 1.0, "its function is a fast one"


def test_a_training_stopped_at_once_leaves_a_model(alice, oval, now):
    job = a_training(alice, oval, now, **SHORT)
    thread = threading.Thread(target=stop_soon, args=(job.pk,))
    thread.start()
    run(job)
    thread.join()
    assert job.state == JobState.STOPPED
    assert job.best_model is not None and job.sb3_zip


def stop_soon(pk: int) -> None:
    """Stop the training as its owner would, as soon as it runs."""
    deadline = monotonic() + 60
    while monotonic() < deadline:
        job = TrainingJob.objects.get(pk=pk)
        if job.state == JobState.RUNNING:
            stop_training(job=job, now=timezone.now())
            break
        sleep(0.1)
    connections.close_all()


def test_a_waiting_training_is_stopped_at_once(alice, oval, now):
    job = a_training(alice, oval, now)
    assert stop_training(job=job, now=now)
    assert (job.state, job.ended_at) == (JobState.STOPPED, now)
    assert not stop_training(job=job, now=now)
    assert not run_next_training(worker="tester")


def kill_the_worker_of(job):
    """Start a worker, and kill it by SIGKILL as soon as there is a checkpoint of the training."""
    command = [sys.executable, "-m", "tests.training.train_worker"]
    worker = subprocess.Popen(command, cwd=CHECKOUT, env=environment("redis://127.0.0.1:1/0"), start_new_session=True)
    try:
        wait_for(lambda: Checkpoint.objects.filter(job=job).exists(), worker)
    finally:
        os.kill(worker.pid, signal.SIGKILL)
        worker.wait()
    job.refresh_from_db()


def test_a_killed_worker_loses_nothing_saved(alice, oval, now):
    job = a_training(alice, oval, now, stop_minutes=5, **SHORT)
    kill_the_worker_of(job)
    checkpoint = Checkpoint.objects.filter(job=job).first()
    assert (job.state, job.attempt, job.worker) == (JobState.RUNNING, 1, "to be killed")
    assert not run_next_training(worker="other"), "the lease is still good"

    TRAININGS.sweep(now=job.leased_until + timedelta(seconds=1))
    job.refresh_from_db()
    assert job.state == JobState.QUEUED
    TrainingJob.objects.filter(pk=job.pk).update(stop_steps=checkpoint.steps + 1500)
    run(job)
    assert (job.state, job.attempt) == (JobState.FINISHED, 2), job.operator_detail
    assert f"goes on from its checkpoint after iteration {checkpoint.iteration}" in job.log
    assert job.steps_done >= checkpoint.steps + 1500
    assert job.seconds_done > checkpoint.seconds
    numbers = list(job.iterations.values_list("number", flat=True))
    assert numbers == list(range(1, len(numbers) + 1))
    steps = list(job.iterations.values_list("steps", flat=True))
    assert steps == sorted(set(steps))
    assert not Checkpoint.objects.exists()
    assert TrainedModel.objects.filter(owner=alice).count() == len({job.best_model_id, job.last_model_id})
    weights = NetworkLayout.of(job.metadata), job.last_model.network.onnx.read()
    assert all(np.isfinite(layer).all() for layer in from_onnx(*weights).values())
    assert job.iterations.last().entropy < math.log(5), "it has learned, and its policy is one still"


@pytest.mark.soak  # with a trainer that is none: tests/training/test_work.py
def test_stopping_a_resumable_training_keeps_best_and_last(alice, oval, now):
    """Its worker was killed, its owner has seen enough: nothing more is learned, and nothing that was is lost."""
    job = a_training(alice, oval, now, stop_minutes=5, **SHORT)
    kill_the_worker_of(job)
    TRAININGS.sweep(now=job.leased_until + timedelta(seconds=1))
    assert stop_training(job=job, now=timezone.now())
    run(job)
    assert (job.state, job.attempt) == (JobState.STOPPED, 2), (job.reason, job.operator_detail)
    assert job.best_model is not None and job.last_model is not None and job.sb3_zip


def wait_for(condition, worker: subprocess.Popen) -> None:
    deadline = monotonic() + 120
    while not condition():
        assert worker.poll() is None, "the worker ended"
        assert monotonic() < deadline, "it took too long"
        sleep(0.1)


def test_a_failing_reward_function_ends_with_code_and_line(alice, oval, now):
    code = "print('loaded')\ndef reward_function(params):\n    print('look:', params['steps'])\n"
    code += "    return 1 / (params['steps'] < 5)\n"
    job = run(a_training(alice, oval, now, reward_code=code, **SHORT))
    assert (job.state, job.reason_code, job.reason_params["line"]) == (JobState.FAILED, "reward_raised", 4)
    assert "division by zero (steps 5, progress " in job.reason, "the state that it came in"
    assert job.best_model is None
    printed = [line[20:] for line in job.log.splitlines() if " print: " in line]
    assert printed[:2] == ["print: loaded", "print: look: 2"], "what it said before it failed is there to be read"
    assert job.printed.startswith("loaded\nlook: ")
    assert not TrainedModel.objects.exists()


def test_a_reward_function_failing_late_costs_nothing_learned(alice, oval, now):
    code = "calls = 0\ndef reward_function(params):\n    global calls\n    calls += 1\n    return 1 / (60 - calls)\n"
    job = run(a_training(alice, oval, now, reward_code=code, **SHORT))
    assert (job.state, job.reason_code, job.reason_params["line"]) == (JobState.FAILED, "reward_raised", 5)
    assert job.iterations.exists() and job.best_model is not None


@pytest.mark.soak  # the trainer that ends so: tests/hostile/test_hostile_trainings.py
def test_a_reward_function_that_exits_hurts_nobody(alice, oval, now):
    code = "def reward_function(params):\n    params.__class__.__base__\n    raise SystemExit(0)\n"
    job = run(a_training(alice, oval, now, reward_code=code, **SHORT))
    assert job.state == JobState.FAILED
    assert job.reason_code in ("reward_raised", "reward_stuck")
