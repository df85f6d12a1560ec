"""PPO learns from rewards of one size, whatever a reward function pays."""

from __future__ import annotations

import numpy as np
import pytest

from paddock.rules.hyperparameters import DEFAULTS, PPO, SAC
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.training.specs import a_spec
from training.trainer.cars import WORTH, RewardScale
from training.trainer.network import NetworkLayout

TRACK = stadium(1.5)


@pytest.mark.parametrize("paid", [0.01, 1.0, 1e5])
def test_a_lasting_reward_is_worth_the_same_whatever_it_is(paid):
    scale = RewardScale(0.97)
    for _ in range(10):
        learned = scale.scaled(np.full(16, paid))
    assert learned.dtype == np.float32
    assert learned.sum() / 16 / (1 - 0.97) == pytest.approx(WORTH, rel=1e-5)


def test_what_is_paid_keeps_its_sign_and_its_share():
    scale = RewardScale(0.97)
    learned = scale.scaled(np.array([4.0, -2.0, 0.0, 2.0]))
    assert (learned / learned[0]).tolist() == [1.0, -0.5, 0.0, 0.5]


@pytest.mark.parametrize("discount", [0.0, 0.999, 1.0])
def test_nothing_paid_is_nothing_and_no_discount_is_no_fault(discount):
    scale = RewardScale(discount)
    assert scale.factor == 1.0
    assert scale.scaled(np.zeros(3)).tolist() == [0.0, 0.0, 0.0] and scale.factor == 1.0
    assert np.isfinite(scale.scaled(np.array([1e5, 1e-3, -1e5]))).all() and scale.factor > 0.0


def test_it_goes_through_a_checkpoint():
    scale, again = RewardScale(0.97), RewardScale(0.97)
    scale.scaled(np.array([1.0, 3.0]))
    again.restore(scale.state())
    assert again.factor == scale.factor != 1.0
    assert again.scaled(np.array([5.0])) == scale.scaled(np.array([5.0]))


@pytest.mark.xdist_group("training")
@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_cars_tell_what_was_paid_and_learn_from_what_it_is_worth(algorithm):
    pytest.importorskip("torch", reason="training is not installed: make training")
    from training.trainer.cars import TrainingCars

    spec = a_spec(TRACK, algorithm)
    cars = TrainingCars(spec, TRACK, [lambda params: 40.0] * 4, list(NetworkLayout.of(spec.metadata).senses), 3)
    cars.reset()
    cars.step_async(np.full(4, 2) if algorithm == PPO else np.zeros((4, 2), np.float32))
    _, rewards, _, _ = cars.step_wait()
    assert cars._earned.tolist() == [40.0] * 4
    worth = WORTH * (1 - DEFAULTS[algorithm]["discount_factor"])
    assert rewards.tolist() == pytest.approx([worth if algorithm == PPO else 40.0] * 4)
    cars.close()
