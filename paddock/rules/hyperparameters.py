"""The list of hyperparameters, by the console's names.

Ranges are those that learners know (deepracer console and DeepRacer on AWS). Defaults are ours, tuned on this simulator
with ``benchmarks/training.py``. PPO takes small batches of little driving: with ten epochs of it a car laps as soon, at
twice the reckoning, and is slower to drive fast. SAC makes much of little driving and needs many steps of learning for
it, so its batches are small and come often. What a learner does with each: :mod:`training.trainer.learners`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .rule import Rule
from .rule import gettext_noop as _

PPO, SAC = ALGORITHMS = ("ppo", "sac")
HUBER, MEAN_SQUARED_ERROR = LOSS_TYPES = ("huber", "mean squared error")


@dataclass(frozen=True)
class Hyperparameter(Rule):
    """``usual``: the default of each algorithm that has it; ``console``: that of the console; ``why``: why ours is
    another. ``sizes``: the only numbers within its range."""

    usual: Mapping[str, Any] = field(default_factory=dict)
    console: Mapping[str, Any] = field(default_factory=dict)
    why: str = ""
    sizes: tuple[int, ...] = ()

    def fits(self, value: Any) -> bool:
        """Whether it may have this value; a whole number may be written with a decimal point."""
        if self.choices:
            return value in self.choices
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not (self.least or 0) <= value <= (self.most or 0):  # not for NaN either
            return False
        if self.sizes and value not in self.sizes:
            return False
        return self.type is float or value == int(value)


def _both(ppo: Any, sac: Any) -> dict[str, Any]:
    return {PPO: ppo, SAC: sac}


_LIST = (
    Hyperparameter(
        "batch_size",
        int,
        None,
        label=_("Batch size"),
        help=_("Steps per gradient update. Larger batches learn more smoothly and more slowly."),
        least=32,
        most=512,
        sizes=(32, 64, 128, 256, 512),
        place=3,
        usual=_both(64, 64),
        console=_both(64, 64),
    ),
    Hyperparameter(
        "num_epochs",
        int,
        None,
        label=_("Epochs"),
        help=_("3 to 10: passes over each batch of experience before it is discarded."),
        least=3,
        most=10,
        place=4,
        usual=_both(4, 6),
        console=_both(10, 1),
        why=_("Experience is cheap here: PPO collects new steps instead of more passes; SAC reuses its replay buffer."),
    ),
    Hyperparameter(
        "lr",
        float,
        None,
        label=_("Learning rate"),
        help=_(
            "0.00000001 to 0.001: how far each update moves the weights. Too large a value destroys what was learned."
        ),
        least=1e-8,
        most=1e-3,
        place=1,
        usual=_both(1e-3, 1e-3),
        console=_both(3e-4, 3e-4),
        why=_("Our small networks with pooled pictures tolerate larger steps. Clones of console models use 0.0003."),
    ),
    Hyperparameter(
        "beta_entropy",
        float,
        None,
        label=_("Entropy"),
        help=_("0 to 1: bonus for random actions. Higher values explore more and converge later."),
        least=0.0,
        most=1.0,
        place=5,
        usual={PPO: 0.01},
        console={PPO: 0.01},
    ),
    Hyperparameter(
        "sac_alpha",
        float,
        None,
        label=_("SAC alpha"),
        help=_("0 to 1: bonus for random actions. Higher values explore more and converge later."),
        least=0.0,
        most=1.0,
        place=6,
        usual={SAC: 0.05},
        console={SAC: 0.2},
        why=_("At 0.2 the entropy bonus outweighs typical rewards."),
    ),
    Hyperparameter(
        "entropy_decay",
        float,
        None,
        label=_("Entropy decay"),
        help=_(
            "0 to 1: share of the entropy bonus that is gone by the end of the training. 0 keeps it constant, 1 lowers "
            "it to zero: explore first, then drive precisely."
        ),
        least=0.0,
        most=1.0,
        place=7,
        usual=_both(0.0, 0.0),
        console=_both(0.0, 0.0),
    ),
    Hyperparameter(
        "discount_factor",
        float,
        None,
        label=_("Discount factor"),
        help=_("0 to 1: weight of a reward one step later. 0.97 looks about 33 steps (two seconds) ahead."),
        least=0.0,
        most=1.0,
        place=2,
        usual=_both(0.97, 0.97),
        console=_both(0.999, 0.999),
        why=_("A horizon of two seconds is enough for a bend, and shorter horizons are learned faster."),
    ),
    Hyperparameter(
        "num_episodes_between_training",
        int,
        None,
        label=_("Episodes between updates"),
        help=_("5 to 100: experience collected before each update. An episode counts as 100 steps."),
        least=5,
        most=100,
        place=8,
        usual=_both(10, 10),
        console=_both(20, 20),
        why=_("Twice as many updates need a fraction of the steps. Each update is followed by an evaluation."),
    ),
    Hyperparameter(
        "loss_type",
        str,
        None,
        label=_("Loss"),
        help=_("Loss function of the value estimate. Huber is less sensitive to outliers."),
        choices=LOSS_TYPES,
        place=9,
        usual=_both(HUBER, MEAN_SQUARED_ERROR),
        console=_both(HUBER, MEAN_SQUARED_ERROR),
    ),
)
HYPERPARAMETERS: Mapping[str, Hyperparameter] = {one.name: one for one in _LIST}
# What each algorithm takes where nobody says otherwise.
DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    algorithm: {one.name: one.usual[algorithm] for one in _LIST if algorithm in one.usual} for algorithm in ALGORITHMS
}
