"""The console's hyperparameters: names, ranges and defaults, and the checks of what a training is asked for.

Ranges are those that learners know (deepracer console and DeepRacer on AWS). Defaults are ours, tuned on this simulator
with ``benchmarks/training.py``. How they map onto stable-baselines3: :mod:`training.trainer.learners`. No Django.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from paddock.errors import UserFault
from paddock.packages.metadata import CONTINUOUS, DISCRETE

PPO, SAC = "ppo", "sac"
HUBER, MEAN_SQUARED_ERROR = "huber", "mean squared error"
LOSS_TYPES = (HUBER, MEAN_SQUARED_ERROR)
LOSS_TYPE = "loss_type"

ACTION_COUNTS = (2, 30)
STEERING_DEG = (-30.0, 30.0)
SPEED_MPS = (0.1, 4.0)


@dataclass(frozen=True)
class Range:
    """What one hyperparameter may be, ends included."""

    low: float
    high: float
    whole: bool


RANGES: Mapping[str, Range] = {
    "batch_size": Range(32, 512, True),
    "num_epochs": Range(3, 10, True),
    "lr": Range(1e-8, 1e-3, False),
    "beta_entropy": Range(0.0, 1.0, False),
    "sac_alpha": Range(0.0, 1.0, False),
    "discount_factor": Range(0.0, 1.0, False),
    "num_episodes_between_training": Range(5, 100, True),
}
_OF = {
    PPO: ("batch_size", "num_epochs", "lr", "beta_entropy", "discount_factor", "num_episodes_between_training"),
    SAC: ("batch_size", "num_epochs", "lr", "sac_alpha", "discount_factor", "num_episodes_between_training"),
}
DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    PPO: {
        "batch_size": 256,
        "num_epochs": 4,
        "lr": 1e-3,
        "beta_entropy": 0.01,
        "discount_factor": 0.97,
        "loss_type": HUBER,
        "num_episodes_between_training": 20,
    },
    SAC: {
        # Small batches, often: SAC makes much of little driving, and needs many steps of learning for it.
        "batch_size": 64,
        "num_epochs": 6,
        "lr": 1e-3,
        "sac_alpha": 0.05,
        "discount_factor": 0.97,
        "loss_type": MEAN_SQUARED_ERROR,
        "num_episodes_between_training": 10,
    },
}
DEFAULT_ACTIONS: tuple[Mapping[str, float], ...] = (
    {"steering_angle": -30.0, "speed": 1.0},
    {"steering_angle": -15.0, "speed": 1.2},
    {"steering_angle": 0.0, "speed": 1.4},
    {"steering_angle": 15.0, "speed": 1.2},
    {"steering_angle": 30.0, "speed": 1.0},
)
DEFAULT_BOUNDS: Mapping[str, Mapping[str, float]] = {
    "steering_angle": {"low": -30.0, "high": 30.0},
    "speed": {"low": 0.5, "high": 2.0},
}


def names_of(algorithm: str) -> tuple[str, ...]:
    """The hyperparameters of an algorithm. Raises UserFault ``training_algorithm``."""
    if algorithm not in _OF:
        raise UserFault("training_algorithm", algorithm=str(algorithm)[:40])
    return (*_OF[algorithm], LOSS_TYPE)


def check_hyperparameters(algorithm: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All hyperparameters of the algorithm, the defaults where none is given.

    Raises UserFault ``training_algorithm``, ``training_hyperparameter_unknown``, ``training_hyperparameter`` (which
    names it and its range) or ``training_loss_type``.
    """
    names = names_of(algorithm)
    for name in given:
        if name not in names:
            raise UserFault("training_hyperparameter_unknown", name=str(name)[:40], known=", ".join(names))
    checked = {**DEFAULTS[algorithm], **given}
    if checked[LOSS_TYPE] not in LOSS_TYPES:
        raise UserFault("training_loss_type")
    for name in names:
        if name != LOSS_TYPE:
            checked[name] = _in_range(name, checked[name])
    return checked


def _in_range(name: str, value: Any) -> int | float:
    bounds = RANGES[name]
    right = isinstance(value, int | float) and not isinstance(value, bool)
    if not right or not bounds.low <= value <= bounds.high or (bounds.whole and value != int(value)):
        raise UserFault("training_hyperparameter", name=name, low=f"{bounds.low:g}", high=f"{bounds.high:g}")
    return int(value) if bounds.whole else float(value)


def check_action_space(algorithm: str, kind: str, given: Any) -> list[dict[str, float]] | dict[str, dict[str, float]]:
    """The action space as ``model_metadata.json`` has it.

    Raises UserFault ``training_sac_continuous``, ``training_action_space``, ``training_action_count``,
    ``training_action_value`` or ``training_action_bounds``.
    """
    if kind not in (DISCRETE, CONTINUOUS):
        raise UserFault("training_action_space")
    if algorithm == SAC and kind == DISCRETE:
        raise UserFault("training_sac_continuous")
    return _discrete(given) if kind == DISCRETE else _continuous(given)


_LIMITS = {"steering_angle": STEERING_DEG, "speed": SPEED_MPS}


def _discrete(given: Any) -> list[dict[str, float]]:
    if not isinstance(given, Sequence) or isinstance(given, str) or not all(isinstance(one, Mapping) for one in given):
        raise UserFault("training_action_space")
    low, high = ACTION_COUNTS
    if not low <= len(given) <= high:
        raise UserFault("training_action_count", low=low, high=high, count=len(given))
    return [
        {name: _action_value(f"#{number}", name, action.get(name)) for name in _LIMITS}
        for number, action in enumerate(given)
    ]


def _continuous(given: Any) -> dict[str, dict[str, float]]:
    if not isinstance(given, Mapping) or not all(isinstance(given.get(name), Mapping) for name in _LIMITS):
        raise UserFault("training_action_space")
    checked = {
        name: {end: _action_value(end, name, given[name].get(end)) for end in ("low", "high")} for name in _LIMITS
    }
    for name, bounds in checked.items():
        if bounds["low"] >= bounds["high"]:
            raise UserFault("training_action_bounds", name=name)
    return checked


def _action_value(where: str, name: str, value: Any) -> float:
    low, high = _LIMITS[name]
    right = isinstance(value, int | float) and not isinstance(value, bool)
    if not right or not low <= value <= high:  # not for NaN either
        raise UserFault("training_action_value", where=where, name=name, low=f"{low:g}", high=f"{high:g}")
    return float(value) + 0.0
