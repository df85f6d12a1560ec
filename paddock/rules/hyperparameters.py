"""The list of hyperparameters, by the console's names."""

# The ranges are those of the DeepRacer console and of DeepRacer on AWS. The defaults are ours, tuned with
# ``benchmarks/training.py``: for PPO small batches of few epochs, as ten epochs take twice the computation and learn to
# drive fast later; for SAC small and frequent batches. :mod:`training.trainer.learners` applies them.

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .rule import Rule
from .rule import gettext_noop as _

PPO, SAC = ALGORITHMS = ("ppo", "sac")
HUBER, MEAN_SQUARED_ERROR = LOSS_TYPES = ("huber", "mean squared error")


@dataclass(frozen=True)
class Hyperparameter(Rule):
    """``usual``, ``console``: our default and the console's by algorithm; ``why``: the reason for another one;
    ``sizes``: the only numbers within the range."""

    usual: Mapping[str, Any] = field(default_factory=dict)
    console: Mapping[str, Any] = field(default_factory=dict)
    why: str = ""
    sizes: tuple[int, ...] = ()

    def fits(self, value: Any) -> bool:
        """Whether the value is valid; a whole number may have a decimal point."""
        if self.choices:
            return value in self.choices
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not (self.least or 0) <= value <= (self.most or 0):  # not for NaN either
            return False
        if self.sizes and value not in self.sizes:
            return False
        return self.type is float or value == int(value)


def _both(ppo: object, sac: object) -> dict[str, object]:
    return {PPO: ppo, SAC: sac}


def _number(name: str, between: tuple[float, float], **attributes: Any) -> Hyperparameter:
    """A number of the type of its bounds."""
    least, most = between
    return Hyperparameter(name, type(least), None, least=least, most=most, **attributes)


_LIST = (
    _number(
        "batch_size",
        (32, 512),
        label=_("Batch size"),
        help=_("Steps per gradient update. Larger batches learn more smoothly and more slowly."),
        sizes=(32, 64, 128, 256, 512),
        place=3,
        usual=_both(64, 64),
        console=_both(64, 64),
    ),
    _number(
        "num_epochs",
        (3, 10),
        label=_("Epochs"),
        help=_("3 to 10: passes over each batch of experience before it is discarded."),
        place=4,
        usual=_both(4, 6),
        console=_both(10, 1),
        why=_("Experience is cheap here: PPO collects new steps instead of more passes; SAC reuses its replay buffer."),
    ),
    _number(
        "lr",
        (1e-8, 1e-3),
        label=_("Learning rate"),
        help=_(
            "0.00000001 to 0.001: how far each update moves the weights. Too large a value destroys what was learned."
        ),
        place=1,
        usual=_both(1e-3, 1e-3),
        console=_both(3e-4, 3e-4),
        why=_("Our small networks with pooled pictures tolerate larger steps. Clones of console models use 0.0003."),
    ),
    _number(
        "beta_entropy",
        (0.0, 1.0),
        label=_("Entropy"),
        help=_("0 to 1: bonus for random actions. Higher values explore more and converge later."),
        place=5,
        usual={PPO: 0.01},
        console={PPO: 0.01},
    ),
    _number(
        "sac_alpha",
        (0.0, 1.0),
        label=_("SAC alpha"),
        help=_("0 to 1: bonus for random actions. Higher values explore more and converge later."),
        place=6,
        usual={SAC: 0.05},
        console={SAC: 0.2},
        why=_("At 0.2 the entropy bonus outweighs typical rewards."),
    ),
    _number(
        "entropy_decay",
        (0.0, 1.0),
        label=_("Entropy decay"),
        help=_(
            "0 to 1: share of the entropy bonus that is gone by the end of the training. 0 keeps it constant, 1 lowers "
            "it to zero: explore first, then drive precisely."
        ),
        place=7,
        usual=_both(0.0, 0.0),
        console=_both(0.0, 0.0),
    ),
    _number(
        "discount_factor",
        (0.0, 1.0),
        label=_("Discount factor"),
        help=_("0 to 1: weight of a reward one step later. 0.97 looks about 33 steps (two seconds) ahead."),
        place=2,
        usual=_both(0.97, 0.97),
        console=_both(0.999, 0.999),
        why=_("A horizon of two seconds is enough for a bend, and shorter horizons are learned faster."),
    ),
    _number(
        "num_episodes_between_training",
        (5, 100),
        label=_("Episodes between updates"),
        help=_("5 to 100: experience collected before each update. An episode counts as 100 steps."),
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
# The defaults of each algorithm.
DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    algorithm: {one.name: one.usual[algorithm] for one in _LIST if algorithm in one.usual} for algorithm in ALGORITHMS
}
