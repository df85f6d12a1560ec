"""A real sweep: the trainer in its sandbox, continued from its own checkpoint."""

from __future__ import annotations

import pytest
from django.utils import timezone

from tests.training.test_sweeps import LR, a_sweep
from training import tasks
from training.models import Checkpoint, JobState, SweepState

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.usefixtures("training_wakes", "wakes"),
    pytest.mark.xdist_group("training"),
]


def test_two_settings_share_seconds_and_the_better_becomes_a_model(alice, oval):
    small = {"num_episodes_between_training": 5, "batch_size": 128, "num_epochs": 3}
    search = {"hyperparameters": LR}
    sweep = a_sweep(alice, oval, timezone.now(), count=2, budget_s=20, search=search, hyperparameters=small, trials=1)
    for _ in range(8):
        if not tasks.train.apply().get():
            break
    sweep.refresh_from_db()
    trials = list(sweep.trials.select_related("job__best_model").order_by("number"))
    logs = "\n".join(trial.job.log for trial in trials)
    assert (sweep.state, [len(trial.results) for trial in trials].count(2)) == (SweepState.FINISHED, 1), logs
    best = sweep.best.job
    assert best.state == JobState.FINISHED
    assert "goes on from its checkpoint" in best.log
    assert best.best_model.name.startswith("tune-")
    first, second = sweep.best.results
    assert 5.0 <= first["seconds"] < 8.0
    assert 14.0 <= second["seconds"] < 20.0, "its own five seconds, and the ten of the second rung"
    assert second["progress"] >= first["progress"] > 0.0
    iterations = list(best.iterations.values_list("number", "seconds"))
    assert [number for number, _ in iterations] == list(range(1, len(iterations) + 1)), "none is lost between rungs"
    assert not Checkpoint.objects.exists()
