"""The same seed on the same machine makes the same weights, each training in a process of its own.

That it makes the same models of the garage is in tests/training/test_run.py, and in every run of the tests.
"""

from __future__ import annotations

import io
from typing import Any

import pytest

from paddock.geometry.catalogue import CATALOGUE
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS, check_hyperparameters
from training.rewards.examples import example
from training.trainer.client import Ended, Iteration, Listener, train
from training.trainer.spec import TrainerSpec

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("training")]


class Kept(Listener):
    def __init__(self) -> None:
        self.iterations: list[Iteration] = []

    def iteration(self, iteration: Iteration) -> None:
        self.iterations.append(iteration)


def trained(algorithm: str, seed: int) -> tuple[list[Iteration], Ended]:
    """A short training, in a process that is started for it and ends with it."""
    discrete = algorithm == "ppo"
    spec = TrainerSpec(
        track=next(entry for entry in CATALOGUE if entry.slug == "oval").geometry().to_dict(),
        race_type="time_trial",
        metadata={
            "action_space_type": "discrete" if discrete else "continuous",
            "action_space": [dict(one) for one in DEFAULT_ACTIONS] if discrete else DEFAULT_BOUNDS,
            "sensor": ["FRONT_FACING_CAMERA"],
            "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
            "training_algorithm": "clipped_ppo" if discrete else "sac",
            "version": "5",
        },
        algorithm=algorithm,
        hyperparameters=check_hyperparameters(
            algorithm, {"num_episodes_between_training": 5, "batch_size": 128, "num_epochs": 3}
        ),
        reward_code=example("race").code,
        stop_seconds=300.0,
        stop_steps=1100,
        trials=1,
        seed=seed,
    )
    kept = Kept()
    return kept.iterations, train(spec, kept)


def tensors(sb3_zip: bytes, algorithm: str) -> dict[str, Any]:
    """Every weight of the file, of the networks that judge states too."""
    from stable_baselines3 import PPO, SAC

    return (PPO if algorithm == "ppo" else SAC).load(io.BytesIO(sb3_zip)).policy.state_dict()


@pytest.mark.soak
@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_the_same_seed_makes_the_same_weights_bit_for_bit(algorithm):
    first, first_end = trained(algorithm, seed=3)
    second, second_end = trained(algorithm, seed=3)
    other, other_end = trained(algorithm, seed=4)
    assert len(first) >= 2
    assert [one.onnx for one in first] == [one.onnx for one in second], "after each update"
    assert first[0].onnx != first[-1].onnx, "it learned"
    weights, again, others = (tensors(end.sb3_zip, algorithm) for end in (first_end, second_end, other_end))
    assert weights.keys() == again.keys() == others.keys()
    assert all(weights[name].equal(again[name]) for name in weights)
    assert not any(weights[name].equal(others[name]) for name in weights if weights[name].dim() > 1)
    assert first[-1].onnx != other[-1].onnx
