"""The track on which a training drives its model when it is done."""

from __future__ import annotations

import pytest

from accounts.models import RacerQuota
from evaluation.models import State
from races.models import OwnEvaluation
from tests.refusals import refused
from tests.rows import track_row
from tests.training.jobs import a_training, network
from training.jobs.services.worker import run_next_training

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes", "wakes")]


def end(job, trainer):
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="test")
    job.refresh_from_db()


def test_the_best_model_is_driven_for_its_owner_on_the_chosen_track(alice, oval, now, trainer):
    other = track_row("kuei-raceway")
    job = a_training(alice, oval, now, evaluate_on=other, direction="cw")
    end(job, trainer)
    run = job.own_evaluation.evaluation
    assert (run.model, run.track, run.owner, run.state) == (job.best_model, other, alice, State.QUEUED)
    assert (job.own_evaluation.rules.laps, job.own_evaluation.rules.direction) == (3, "cw")
    assert job.evaluate_reason == ""


def test_a_training_without_a_track_drives_nothing(alice, oval, now, trainer):
    job = a_training(alice, oval, now)
    end(job, trainer)
    assert job.own_evaluation is None and not OwnEvaluation.objects.exists()


def test_a_full_quota_is_told_and_the_model_is_kept(alice, oval, now, trainer):
    job = a_training(alice, oval, now, evaluate_on=oval)
    RacerQuota.objects.create(racer=alice, name="own_runs_a_day", limit=0)
    end(job, trainer)
    assert job.best_model is not None and job.own_evaluation is None
    assert job.evaluate_reason_code == "own_runs_a_day" and job.evaluate_reason


def test_a_run_failing_through_us_keeps_the_model(alice, oval, now, trainer, monkeypatch):
    def broken(**_):
        raise RuntimeError("the disk is full")

    monkeypatch.setattr("training.jobs.services.results.drive_own", broken)
    job = a_training(alice, oval, now, evaluate_on=oval)
    end(job, trainer)
    assert job.best_model is not None and job.evaluate_reason_code == "evaluate_failed"


def test_where_its_layout_has_no_room_is_refused_before_it_begins(alice, oval, now):
    layout = {"race_type": "object_avoidance", "boxes": [{"fraction": 0.5, "lane": "inner"}]}
    open_track = track_row("straight-track")
    head = {"race_type": "head_to_head", "bots": 1}
    assert a_training(alice, oval, now, evaluate_on=open_track, name="boxes", **layout)
    fault = refused(
        "training_evaluate_on", a_training, owner=alice, track=oval, now=now, evaluate_on=open_track, **head
    )
    assert "loop" in fault.params["problem"]
