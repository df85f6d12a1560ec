"""A trainer's turn around the training itself: shutdowns, faults and a garage that has filled up meanwhile."""

from __future__ import annotations

import numpy as np
import onnx
import pytest
from django.core.files.storage import default_storage

from evaluation.models import TrainedModel
from faults import PlatformFault, UserFault
from tests.factories import a_race
from tests.rows import model_row
from tests.training.jobs import a_training
from training.models import Checkpoint, JobState
from training.services import run_next_training, spec_of, work
from training.trainer.client import Ended, SavedState
from training.trainer.network import Layout, to_onnx

from .test_leases import an_iteration

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.usefixtures("training_bell", "bell")]


def network(job, seed: int) -> bytes:
    """A network that the gate admits, with weights of its own."""
    layout, rng = Layout.of(job.metadata), np.random.default_rng(seed)
    return to_onnx(layout, {name: rng.normal(0, 0.1, shape) for name, shape in layout.shapes.items()}, squash=False)


def weights(onnx_bytes: bytes) -> list[bytes]:
    """What a network weighs, however it is written down."""
    return sorted(
        one.raw_data or str(one.float_data).encode() for one in onnx.load_from_string(onnx_bytes).graph.initializer
    )


@pytest.fixture
def trainer(monkeypatch):
    """In place of the walled process: two iterations, the first the best; then whatever ``at_the_end`` does."""

    class Trainer:
        def __init__(self) -> None:
            self.starts: list[str] = []
            self._turn = None
            self.at_the_end = lambda: Ended("time", 200, 2.0, b"zip")

        def take_over(self, turn) -> None:
            """The next time do this instead."""
            self._turn = turn

        def __call__(self, spec, listener, *, start, blob, asked_to_stop, abandoned):
            if self._turn is not None:
                return self._turn(spec, listener)
            self.starts.append(start)
            listener.ready()
            first, second = an_iteration(1), an_iteration(2, is_best=False)
            listener.iteration(type(first)(first.values, first.driving, self.networks[0], b"gz"))
            listener.checkpoint(SavedState(1, 100, 1.0, b"state"))
            listener.iteration(type(second)(second.values, second.driving, self.networks[1], b""))
            if abandoned():
                raise UserFault("stopped")
            return self.at_the_end()

    made = Trainer()
    monkeypatch.setattr(work, "train", made)
    return made


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


def test_a_name_that_was_taken_meanwhile_gets_a_number(job, alice):
    model_row(alice, name="first")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert job.best_model.name == "first-2"


def test_a_worker_that_shuts_down_hands_it_back_with_its_checkpoint(job, trainer):
    assert run_next_training(worker="w", interrupted=lambda: True)
    job.refresh_from_db()
    assert (job.state, job.attempt) == (JobState.QUEUED, 0)
    run_next_training(worker="v")
    assert trainer.starts == ["", "checkpoint"]


def test_our_fault_sends_it_back_to_go_on(job, trainer):
    trainer.at_the_end = fail(PlatformFault("trainer_died", how="signal 9"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.attempt) == (JobState.QUEUED, 1)
    assert "trainer_died" in job.operator_detail
    assert not TrainedModel.objects.exists()


def test_the_best_of_an_earlier_attempt_is_kept(job, trainer):
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


def test_a_training_that_gives_up_keeps_what_it_had_learned(job, trainer, settings):
    settings.EVALUATION_MAX_ATTEMPTS = 1
    trainer.at_the_end = fail(PlatformFault("trainer_error", detail="TypeError: x"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.reason_code) == (JobState.FAILED, "training_broke_down")
    assert job.best_model.name == "first"
    assert "TypeError" in job.operator_detail
    assert not Checkpoint.objects.exists()


def test_one_that_had_to_be_cut_off_keeps_what_it_had_learned(job, trainer):
    trainer.at_the_end = lambda: Ended("stopped", 200, 2.0, b"")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.best_model.name, bool(job.sb3_zip)) == (JobState.STOPPED, "first", False)


class TestAFullDisk:
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
    def test_costs_a_training_no_more_than_what_it_could_not_keep(self, job, trainer, full, ending):
        full.ending = ending
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, job.best_model.name) == (JobState.FINISHED, "first")
        kept = default_storage.listdir("training/" + job.public_id)[1]
        assert not [name for name in kept if name.endswith((".checkpoint", ".networks", ending))]

    def test_at_the_very_end_is_our_fault_and_the_training_goes_on_from_its_checkpoint(self, job, trainer, full):
        full.ending = ".zip"
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, job.attempt, job.lease) == (JobState.QUEUED, 1, None)
        full.ending = ".none"
        run_next_training(worker="w")
        job.refresh_from_db()
        assert (job.state, trainer.starts) == (JobState.FINISHED, ["", "checkpoint"])


def test_a_racers_fault_ends_it_with_what_it_had_learned(job, trainer):
    trainer.at_the_end = fail(UserFault("reward_raised", line=4, error="KeyError"))
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.reason_code, job.best_model.name) == (JobState.FAILED, "reward_raised", "first")


def test_a_garage_that_has_filled_up_is_the_reason_it_ends_with(job, alice, settings):
    settings.MODELS_PER_RACER = 1
    model_row(alice, name="another")
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.reason_code) == (JobState.FAILED, "garage_full")


def test_a_race_that_refuses_the_model_is_told_beside_a_finished_training(alice, oval, now, trainer):
    race = a_race(now, track=oval, sensors=["STEREO_CAMERAS"])  # long closed by today's clock, or not: refused anyway
    job = a_training(alice, oval, now, submit_to_race=race)
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.submission) == (JobState.FINISHED, None)
    assert job.submit_reason_code and job.submit_reason
    assert job.best_model == job.last_model, "one network is one model"


def test_the_trainer_gets_to_know_what_was_asked_for_and_nothing_of_the_racer(job):
    told = spec_of(job, 12.0).to_dict()
    assert (told["seconds_before"], told["stop_seconds"], told["seed"]) == (12.0, 600.0, 0)
    assert "alice" not in str(told)


def test_a_submission_that_fails_through_us_is_told_and_the_model_is_kept(alice, oval, now, trainer, monkeypatch):
    def broken(**_):
        raise RuntimeError("the disk is full")

    monkeypatch.setattr("training.services.results.submit_model", broken)
    job = a_training(alice, oval, now, submit_to_race=a_race(now, track=oval))
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.submit_reason_code) == (JobState.FINISHED, "submit_failed")
    assert job.best_model is not None
