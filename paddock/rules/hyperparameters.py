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
    another."""

    usual: Mapping[str, Any] = field(default_factory=dict)
    console: Mapping[str, Any] = field(default_factory=dict)
    why: str = ""

    def fits(self, value: Any) -> bool:
        """Whether it may have this value; a whole number may be written with a decimal point."""
        if self.choices:
            return value in self.choices
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not (self.least or 0) <= value <= (self.most or 0):  # not for NaN either
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
        help=_("Steps looked at together. Larger batches learn more smoothly and more slowly."),
        least=32,
        most=512,
        place=3,
        usual=_both(64, 64),
        console=_both(64, 64),
    ),
    Hyperparameter(
        "num_epochs",
        int,
        None,
        label=_("Epochs"),
        help=_("3 to 10: how often each batch of driving is gone through before it is thrown away."),
        least=3,
        most=10,
        place=4,
        usual=_both(4, 6),
        console=_both(10, 1),
        why=_(
            "Driving is cheap here: PPO drives anew instead of going through it "
            "once more, SAC gets more out of what it remembers."
        ),
    ),
    Hyperparameter(
        "lr",
        float,
        None,
        label=_("Learning rate"),
        help=_("0.00000001 to 0.001: how far each update moves the weights. Too far, and it forgets."),
        least=1e-8,
        most=1e-3,
        place=1,
        usual=_both(1e-3, 1e-3),
        console=_both(3e-4, 3e-4),
        why=_(
            "Ours learn from pooled pictures with a small network, which bears "
            "larger steps. Clones of the console take 0.0003."
        ),
    ),
    Hyperparameter(
        "beta_entropy",
        float,
        None,
        label=_("Entropy"),
        help=_("0 to 1: how much it is paid for being undecided. More explores more, and settles later."),
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
        help=_("0 to 1: how much it is paid for being undecided. More explores more, and settles later."),
        least=0.0,
        most=1.0,
        place=6,
        usual={SAC: 0.05},
        console={SAC: 0.2},
        why=_("The usual rewards are small beside what 0.2 pays for being undecided."),
    ),
    Hyperparameter(
        "discount_factor",
        float,
        None,
        label=_("Discount factor"),
        help=_("0 to 1: what a reward is worth one step later. 0.97 looks about 33 steps, two seconds, ahead."),
        least=0.0,
        most=1.0,
        place=2,
        usual=_both(0.97, 0.97),
        console=_both(0.99, 0.99),
        why=_("Two seconds ahead are enough to take a bend, and what lies closer is learned faster."),
    ),
    Hyperparameter(
        "num_episodes_between_training",
        int,
        None,
        label=_("Episodes between updates"),
        help=_("5 to 100: how much is driven before each update. An episode counts as 100 steps."),
        least=5,
        most=100,
        place=7,
        usual=_both(10, 10),
        console=_both(20, 20),
        why=_("Updates that come twice as often need a fraction of the driving; the car is looked at after each."),
    ),
    Hyperparameter(
        "loss_type",
        str,
        None,
        label=_("Loss"),
        help=_("How wrong expectations are counted. Huber takes outliers less to heart."),
        choices=LOSS_TYPES,
        place=8,
        usual=_both(HUBER, MEAN_SQUARED_ERROR),
        console=_both(HUBER, MEAN_SQUARED_ERROR),
    ),
)
HYPERPARAMETERS: Mapping[str, Hyperparameter] = {one.name: one for one in _LIST}
# What each algorithm takes where nobody says otherwise.
DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    algorithm: {one.name: one.usual[algorithm] for one in _LIST if algorithm in one.usual} for algorithm in ALGORITHMS
}
