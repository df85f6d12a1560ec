"""The console's own values and batch sizes, and entropy that falls during a training."""

from __future__ import annotations

import pytest

from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.hyperparameters import HYPERPARAMETERS
from tests.training.specs import a_spec
from training.jobs.settings_checks import check_hyperparameters
from training.wizard.hyperparameters import FILLS


def test_the_consoles_discount_is_0_999():
    assert [FILLS["console"][algorithm]["discount_factor"] for algorithm in ("ppo", "sac")] == ["0.999", "0.999"]


@pytest.mark.parametrize("size", [32, 64, 128, 256, 512, 64.0])
def test_the_consoles_batch_sizes_are_taken(size):
    assert check_hyperparameters("ppo", {"batch_size": size})["batch_size"] == size


@pytest.mark.parametrize(
    ("size", "code"),
    [
        *((size, "training_batch_size") for size in (33, 100, 511)),
        *((size, "training_hyperparameter") for size in (31, 1024, 64.5)),
    ],
)
def test_other_batch_sizes_are_refused(size, code):
    with pytest.raises(UserFault) as fault:
        check_hyperparameters("sac", {"batch_size": size})
    assert fault.value.code == code
    if code == "training_batch_size":
        assert str(fault.value) == "The batch size must be one of 32, 64, 128, 256, 512."


def test_every_default_is_taken_where_it_is_shown():
    for one in HYPERPARAMETERS.values():
        for values in (one.usual, one.console):
            for algorithm, value in values.items():
                assert check_hyperparameters(algorithm, {one.name: value})[one.name] == value


@pytest.mark.parametrize(
    ("algorithm", "name", "decay", "expected"),
    [
        ("ppo", "beta_entropy", 1.0, [0.1, 0.05, 0.0, 0.0]),
        ("sac", "sac_alpha", 1.0, [0.1, 0.05, 0.0, 0.0]),
        ("ppo", "beta_entropy", 0.5, [0.1, 0.075, 0.05, 0.05]),
        ("sac", "sac_alpha", 0.0, [0.1, 0.1, 0.1, 0.1]),
        ("ppo", "beta_entropy", None, [0.1, 0.1, 0.1, 0.1]),  # a training of an earlier version
    ],
)
def test_entropy_falls_over_the_training(algorithm, name, decay, expected):
    pytest.importorskip("torch", reason="training is not installed: make training")
    from stable_baselines3.common.callbacks import BaseCallback

    from paddock.simulator.rewards import follow_centre_line
    from training.trainer.cars import TrainingCars
    from training.trainer.learners import Learner
    from training.trainer.network import NetworkLayout
    from training.trainer.spec import CARS

    class Silent(BaseCallback):
        def _on_step(self) -> bool:
            return True

    track, share = by_slug("oval").geometry(), [0.0]
    spec = a_spec(track, algorithm, {name: 0.1, "entropy_decay": decay})
    if decay is None:
        del spec.hyperparameters["entropy_decay"]
    layout = NetworkLayout.of(spec.metadata)
    cars = TrainingCars(spec, track, [follow_centre_line] * CARS, list(layout.senses), 0)
    learner = Learner(spec, layout, cars, Silent(), share=lambda: share[0])
    worth = []
    for over in (0.0, 0.5, 1.0, 1.2):
        share[0] = over
        worth.append(learner.exploring())
    cars.close()
    assert worth == pytest.approx(expected)
