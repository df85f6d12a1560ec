"""Checks of a training's settings, hyperparameters and action space, and tables of actions. Imports no Django."""

from collections.abc import Mapping, Sequence
from typing import Any

from paddock.errors import UserFault
from paddock.errors.reasons import gettext_noop as _
from paddock.packages.metadata import CONTINUOUS, DISCRETE
from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS, SAC
from paddock.rules.training import RANDOMISED, SETTINGS, TrainingSettings

ACTION_COUNTS = (2, 30)
STEERING_DEG = (-30.0, 30.0)
SPEED_MPS = (0.1, 4.0)


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


# Of the console's first years (hyperparameters.json of an export has them still)
_EXPLORATION = ("exploration_type", "e_greedy_value", "epsilon_steps")


def names_of(algorithm: str) -> tuple[str, ...]:
    """The hyperparameters of an algorithm. Raises UserFault ``training_algorithm``."""
    if algorithm not in DEFAULTS:
        raise UserFault("training_algorithm", algorithm=str(algorithm)[:40])
    return tuple(DEFAULTS[algorithm])


def check_hyperparameters(algorithm: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All hyperparameters of the algorithm, the defaults where none is given.

    Raises UserFault ``training_algorithm``, ``training_exploration``, ``training_hyperparameter_unknown``,
    ``training_hyperparameter`` (which names it and its range), ``training_batch_size`` or ``training_loss_type``.
    """
    names = names_of(algorithm)
    for name in given:
        if name in _EXPLORATION:
            raise UserFault("training_exploration", name=name)
        if name not in names:
            raise UserFault("training_hyperparameter_unknown", name=str(name)[:40], known=", ".join(names))
    # choices first: a mistaken choice mostly comes with correct numbers
    asked = sorted((HYPERPARAMETERS[name] for name in names), key=lambda one: not one.choices)
    checked = {**DEFAULTS[algorithm], **given}
    for one in asked:
        value = checked[one.name]
        if one.fits(value) or (type(value) is one.type and value == one.console[algorithm]):
            checked[one.name] = value if one.choices else one.type(value)
        elif one.choices:
            raise UserFault("training_loss_type")
        elif one.sizes and value in range(one.sizes[0], one.sizes[-1] + 1):
            raise UserFault("training_batch_size", sizes=", ".join(map(str, one.sizes)))
        else:
            bounds = {"low": f"{one.least:g}", "high": f"{one.most:g}"}
            raise UserFault("training_hyperparameter", name=one.name, label=str(one.label), **bounds)
    return checked


# Which reason a setting is refused with; those of a range say it.
REFUSALS = {
    "stop_minutes": "training_minutes",
    "stop_steps": "training_steps",
    "stop_clean_laps": "training_clean_laps",
    "trials": "training_trials",
    "seed": "training_seed",
    "best_metric": "training_best_metric",
    "alternate_direction": "training_alternate_direction",
    **dict.fromkeys(RANDOMISED, "training_randomisation"),
}
_RANGES = ("stop_minutes", "stop_clean_laps", "trials")


def check_settings(settings: TrainingSettings) -> None:
    """Raises UserFault with one of :data:`REFUSALS`."""
    for name, code in REFUSALS.items():
        rule = SETTINGS[name]
        try:
            rule.check(getattr(settings, name))
        except ValueError:
            bounds: dict[str, float | str] = (
                dict(zip(("low", "high"), rule.bounds, strict=True)) if name in _RANGES else {}
            )
            if name in RANDOMISED:
                bounds = {"name": name, "label": str(rule.label)}
            raise UserFault(code, **bounds) from None


def check_action_space(algorithm: str, kind: str, given: Any) -> list[dict[str, float]] | dict[str, dict[str, float]]:
    """The action space as ``model_metadata.json`` has it.

    Raises UserFault ``training_sac_continuous``, ``training_action_space``, ``training_action_count``,
    ``training_action_value``, ``training_range_value`` or ``training_action_bounds``.
    """
    if kind not in (DISCRETE, CONTINUOUS):
        raise UserFault("training_action_space")
    if algorithm == SAC and kind == DISCRETE:
        raise UserFault("training_sac_continuous")
    return _discrete(given) if kind == DISCRETE else _continuous(given)


_LIMITS = {"steering_angle": STEERING_DEG, "speed": SPEED_MPS}
_LABELS = {"steering_angle": _("steering angle"), "speed": _("speed")}


def _discrete(given: Any) -> list[dict[str, float]]:
    if not isinstance(given, Sequence) or isinstance(given, str) or not all(isinstance(one, Mapping) for one in given):
        raise UserFault("training_action_space")
    low, high = ACTION_COUNTS
    if not low <= len(given) <= high:
        raise UserFault("training_action_count", low=low, high=high, count=len(given))
    return [
        {name: _action_value(name, action.get(name), code="training_action_value", where=number) for name in _LIMITS}
        for number, action in enumerate(given)
    ]


def _continuous(given: Any) -> dict[str, dict[str, float]]:
    if not isinstance(given, Mapping) or not all(isinstance(given.get(name), Mapping) for name in _LIMITS):
        raise UserFault("training_action_space")
    checked = {
        name: {
            end: _action_value(name, given[name].get(end), code="training_range_value", where=end)
            for end in ("low", "high")
        }
        for name in _LIMITS
    }
    for name, bounds in checked.items():
        if bounds["low"] >= bounds["high"]:
            raise UserFault("training_action_bounds", name=name, label=_LABELS[name])
    return checked


def _action_value(name: str, value: Any, *, code: str, where: int | str) -> float:
    low, high = _LIMITS[name]
    right = isinstance(value, int | float) and not isinstance(value, bool)
    if not right or not low <= value <= high:  # not for NaN either
        bounds = {"low": f"{low:g}".replace("-", "−"), "high": f"{high:g}"}
        raise UserFault(code, where=where, name=name, label=_LABELS[name], **bounds)
    return float(value) + 0.0


# The console's 3, 5 or 7 steering angles and 1 to 3 speeds, and a few more: no more than 30 actions in all.
STEERING_GRANULARITIES = (2, 3, 5, 7, 9)
SPEED_GRANULARITIES = (1, 2, 3)


def discrete_actions(
    max_steering_deg: float, steerings: int, max_speed_mps: float, speeds: int
) -> list[dict[str, float]]:
    """``steerings`` angles spread evenly over both sides, each with ``speeds`` even shares of the greatest speed, as in
    the console: right to left, slow to fast."""
    angles = [-max_steering_deg + 2 * max_steering_deg * i / (steerings - 1) for i in range(steerings)]
    return [
        {"steering_angle": round(angle, 2) + 0.0, "speed": max(SPEED_MPS[0], round(max_speed_mps * k / speeds, 2))}
        for angle in angles
        for k in range(1, speeds + 1)
    ]
