"""A trainer's turn around the training itself: shutdowns, faults and a garage that has filled up meanwhile."""

from __future__ import annotations

from dataclasses import asdict
from datetime import timedelta

import numpy as np
import onnx
import pytest
from django.core.files.storage import default_storage
from django.utils import timezone

from core.jobs import stopping
from evaluation.models import TrainedModel
from paddock.errors import PlatformFault, UserFault
from tests.rows import model_row
from tests.training.jobs import a_training, an_iteration, network
from training import tasks
from training.jobs.services.queue import KEEPINGS_TRIED, TRAININGS
from training.jobs.services.records import keep_checkpoint, record_iteration
from training.jobs.services.results import admit_networks
from training.jobs.services.worker import run_next_training, spec_of
from training.models import Checkpoint, JobState, TrainingJob
from training.trainer.client import Ended, SavedState
from training.trainer.network import NetworkLayout, to_onnx

pytestmark = [
    pytest.mark.django_db(transaction=True),
    pytest.mark.usefixtures("training_wakes", "wakes", "admitted_here"),
]


def weights(onnx_bytes: bytes) -> list[bytes]:
    """What a network weighs, however it is written down."""
    return sorted(
        one.raw_data or str(one.float_data).encode() for one in onnx.load_from_string(onnx_bytes).graph.initializer
    )


@pytest.fixture
def job(alice, oval, now, trainer):
    job = a_training(alice, oval, now)
    trainer.networks = [network(job, 1), network(job, 2)]
    return job


def fail(fault):
    def raising():
        raise fault

    return raising


def test_best_and_last_become_two_models(job, trainer):
    assert run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.best_model.name, job.last_model.name) == (JobState.FINISHED, "first", "first-last")
    assert job.best_model.network_id != job.last_model.network_id
    assert (job.steps_done, job.seconds_done) == (200, 2.0)
    assert not Checkpoint.objects.exists()


@pytest.mark.parametrize(
    ("why", "state"), [("time", "finished"), ("steps", "finished"), ("clean_laps", "finished"), ("stopped", "stopped")]
)
def test_the_end_is_written_down(job, trainer, why, state):
    trainer.at_the_end = lambda: Ended(why, 200, 2.0, b"zip")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.ended_because) == (state, why)


def test_a_model_whose_name_was_taken_gets_a_number(job, alice):
    model_row(alice, name="first")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert job.best_model.name == "first-2"


def test_a_worker_shutting_down_hands_back_the_checkpoint(job, trainer):
    assert run_next_training(worker="w", interrupted=lambda: True)
    job.refresh_from_db()
    assert (job.state, job.attempt) == (JobState.QUEUED, 0)
    run_next_training(worker="v")
    assert trainer.starts == ["", "checkpoint"]


def test_a_worker_told_to_stop_begins_no_training(job, trainer, monkeypatch):
    monkeypatch.setattr(stopping, "is_stopping", lambda: True)
    assert tasks.train.apply().get() is False
    job.refresh_from_db()
    assert (job.state, job.attempt) == (JobState.QUEUED, 0)
    assert not trainer.starts


def test_a_platform_fault_requeues_the_training(job, trainer):
    trainer.at_the_end = fail(PlatformFault("trainer_died", how="signal 9"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.attempt) == (JobState.QUEUED, 1)
    assert "trainer_died" in job.operator_detail
    assert not TrainedModel.objects.exists()


def test_the_best_of_an_earlier_attempt_survives(job, trainer):
    """The trainer goes on from its checkpoint and does not get better: the best is the one before it was cut off."""
    assert run_next_training(worker="w", interrupted=lambda: True)
    best, after = trainer.networks[0], network(job, 3)

    def go_on(spec, listener, **_):
        later = an_iteration(2, is_best=False)
        listener.iteration(type(later)(later.values, later.driving, after, b""))
        return Ended("time", 300, 3.0, b"zip")

    trainer.take_over(go_on)
    run_next_training(worker="v")
    job.refresh_from_db()
    assert job.state == JobState.FINISHED, job.log
    with job.best_model.network.onnx.open() as kept, job.last_model.network.onnx.open() as last:
        assert (weights(kept.read()), weights(last.read())) == (weights(best), weights(after))


def test_a_training_given_up_keeps_what_it_learned(job, trainer, settings):
    settings.EVALUATION_MAX_ATTEMPTS = 1
    trainer.at_the_end = fail(PlatformFault("trainer_error", detail="TypeError: x"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.reason_code) == (JobState.FAILED, "training_broke_down")
    assert job.best_model.name == "first"
    assert "TypeError" in job.operator_detail
    assert not Checkpoint.objects.exists()


def test_a_training_cut_off_keeps_what_it_learned(job, trainer):
    trainer.at_the_end = lambda: Ended("stopped", 200, 2.0, b"")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.best_model.name, bool(job.sb3_zip)) == (JobState.STOPPED, "first", False)


class TestFullDisk:
    @pytest.fixture
    def full(self, monkeypatch):
        """Files of trainings cannot be written; ``full.ending`` says which."""
        real = default_storage.save

        class Full:
            ending = ""

            def __call__(self, name, content, **more):
                if name.startswith("training/") and name.endswith(self.ending):
                    raise OSError(28, "No space left on device")
                return real(name, content, **more)

        disk = Full()
        monkeypatch.setattr(default_storage, "save", disk)
        return disk

    @pytest.mark.parametrize("ending", [".checkpoint", ".networks", ".csv.gz"])
    def test_it_costs_only_what_could_not_be_kept(self, job, trainer, full, ending):
        full.ending = ending
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, job.best_model.name) == (JobState.FINISHED, "first")
        kept = default_storage.listdir("training/" + job.public_id)[1]
        assert not [name for name in kept if name.endswith((".checkpoint", ".networks", ending))]

    def test_at_the_very_end_the_training_resumes_from_a_checkpoint(self, job, trainer, full):
        full.ending = ".zip"
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, job.attempt, job.lease) == (JobState.QUEUED, 1, None)
        full.ending = ".none"
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, trainer.starts) == (JobState.FINISHED, ["", "checkpoint"])


def test_a_training_keeps_what_it_learned_after_a_racers_fault(job, trainer):
    trainer.at_the_end = fail(UserFault("reward_raised", line=4, error="KeyError"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.reason_code, job.best_model.name) == (JobState.FAILED, "reward_raised", "first")


def test_a_garage_filled_meanwhile_still_takes_the_models(job, alice, settings):
    """There was room when it was taken on."""
    settings.MODELS_PER_RACER = 1
    model_row(alice, name="another")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.best_model.name, job.last_model.name) == (JobState.FINISHED, "first", "first-last")


class TestTrainingGivenUp:
    """Whatever ends a training, what its last checkpoint holds becomes its models, once."""

    @pytest.fixture(autouse=True)
    def _attempts(self, settings):
        settings.EVALUATION_MAX_ATTEMPTS = 3

    def break_down(self, job, *, with_checkpoint: bool = True) -> None:
        """Its process says three times that it failed, after one checkpoint."""
        at = timezone.now() - timedelta(hours=9)
        TrainingJob.objects.update(created_at=at)
        for number in range(3):
            held = TRAININGS.claim(worker=f"w{number}", now=at)
            assert held == job
            if with_checkpoint and not number:
                record_iteration(job=held, lease=held.lease, iteration=an_iteration(1), now=at)
                networks = (network(job, 1), network(job, 2))
                state = SavedState(1, 100, 1.0, b"state")
                keep_checkpoint(job=held, lease=held.lease, saved=state, networks=networks, now=at)
            fault = PlatformFault("trainer_error", detail="x")
            TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=at)
            at += timedelta(hours=1)
        job.refresh_from_db()

    def test_it_leaves_the_models_of_its_last_checkpoint(self, job, trainer):
        self.break_down(job)
        assert (job.state, job.reason_code) == (JobState.QUEUED, "training_broke_down"), "its models are to be kept yet"
        assert run_next_training(worker="another")
        job.refresh_from_db()
        assert (job.state, job.reason_code) == (JobState.FAILED, "training_broke_down")
        assert job.reason_params["attempts"] == 3
        assert trainer.starts == [], "it is not trained once more"
        with job.best_model.network.onnx.open() as best, job.last_model.network.onnx.open() as last:
            kept = weights(best.read()), weights(last.read())
        assert kept == tuple(weights(each) for each in trainer.networks)
        assert TrainedModel.objects.count() == 2
        assert not Checkpoint.objects.exists()
        assert not run_next_training(worker="another"), "nothing is left to do"

    def test_it_leaves_no_model_without_a_checkpoint(self, job):
        self.break_down(job, with_checkpoint=False)
        assert (job.state, job.reason_code, job.best_model) == (JobState.FAILED, "training_broke_down", None)

    def test_workers_lost_while_keeping_models_cost_no_model(self, job):
        """They are in the garage already, and the next worker finds them there, however many disappear."""
        self.break_down(job)
        at = timezone.now() - timedelta(hours=5)
        for lost in range(6):
            held = TRAININGS.claim(worker="also lost", now=at)
            if not lost:
                admit_networks(job=held, best=network(job, 1), last=network(job, 2), now=at)
            at += timedelta(minutes=30)
            TRAININGS.sweep(now=at)
            held.refresh_from_db()
            assert held.state == JobState.QUEUED
            TrainingJob.objects.update(not_before=None)
        run_next_training(worker="another")
        job.refresh_from_db()
        assert (job.state, job.best_model.name, job.last_model.name) == (JobState.FAILED, "first", "first-last")
        assert TrainedModel.objects.count() == 2

    def test_our_own_mistakes_are_not_retried_without_end(self, job, now):
        self.break_down(job)
        mistakes = 0
        while (held := TRAININGS.claim(worker="w", now=timezone.now() + timedelta(days=mistakes))) is not None:
            fault = PlatformFault("internal_error")
            TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=timezone.now())
            mistakes += 1
            assert mistakes < 20
        job.refresh_from_db()
        assert (job.state, job.reason_code, mistakes) == (JobState.FAILED, "training_broke_down", KEEPINGS_TRIED)
        assert not Checkpoint.objects.exists()

    def test_an_unreadable_checkpoint_costs_only_itself(self, job, trainer, now):
        held = TRAININGS.claim(worker="w", now=now)
        for number, networks in ((1, (1, 2)), (2, (3, 4))):
            state, made = SavedState(number, 100, 1.0, b"state"), tuple(network(job, seed) for seed in networks)
            keep_checkpoint(job=held, lease=held.lease, saved=state, networks=made, now=now)
        default_storage.delete(Checkpoint.objects.first().networks.name)
        default_storage.delete(Checkpoint.objects.first().file.name)
        TRAININGS.sweep(now=now + timedelta(hours=1))
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, job.reason_code, trainer.starts) == (JobState.FINISHED, "", ["checkpoint"])
        assert "the checkpoint after iteration 2 is damaged" in job.log
        assert "goes on from its checkpoint after iteration 1" in job.log


def test_a_refused_last_network_does_not_cost_the_best(job, trainer):
    """It may be what a reward function made of it."""
    layout = NetworkLayout.of(job.metadata)
    broken = to_onnx(layout, {name: np.full(shape, np.nan) for name, shape in layout.shapes.items()}, squash=False)
    trainer.networks[1] = broken
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.best_model.name, job.last_model) == (JobState.FINISHED, "first", job.best_model)
    assert "the last network" in job.log


def test_the_trainer_learns_nothing_about_the_racer(job):
    told = asdict(spec_of(job, Checkpoint(seconds=12.0, iteration=3)))
    assert (told["seconds_before"], told["stop_seconds"], told["seed"]) == (12.0, 600.0, 0)
    assert "alice" not in str(told)
