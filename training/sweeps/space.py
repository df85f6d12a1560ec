"""The search space of a sweep, checked when the sweep is created. Imports no Optuna."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from paddock.errors import UserFault
from paddock.rules.hyperparameters import HYPERPARAMETERS

from ..jobs.settings_checks import check_action_space, check_hyperparameters
from ..models.sweep import (
    SETTINGS_LEAST,
    SETTINGS_MOST,
    ActionSpaceChoice,
    SearchRange,
    SearchSpace,
    TrialSetting,
)
from .halving import LEAST_S, rungs_of

ACTION_SPACE, REWARD_FUNCTION = "action_space", "reward_function"  # beside the hyperparameters' names
VARIANTS_MOST = 6  # action spaces, and reward functions, with the base training's


def is_whole(name: str) -> bool:
    return HYPERPARAMETERS[name].type is int


def checked_space(
    *,
    algorithm: str,
    base: ActionSpaceChoice,
    reward_code: str,
    hyperparameters: Mapping[str, Mapping[str, Any]],
    action_spaces: Sequence[ActionSpaceChoice] = (),
    reward_functions: Sequence[str] = (),
) -> SearchSpace:
    """The space with the base training's action space and reward function first, equal ones once.

    Raises UserFault ``sweep_range``, ``sweep_variants``, ``sweep_space_empty`` and those of the checks of
    hyperparameters and action spaces.
    """
    spaces: list[ActionSpaceChoice] = []
    for one in (base, *action_spaces):
        kind = one["action_space_type"]
        choice: ActionSpaceChoice = {
            "action_space_type": kind,
            "action_space": check_action_space(algorithm, kind, one["action_space"]),
        }
        if choice not in spaces:
            spaces.append(choice)
    codes = list(dict.fromkeys(code.replace("\r\n", "\n") for code in (reward_code, *reward_functions)))
    for variants in (spaces, codes):
        if len(variants) > VARIANTS_MOST:
            raise UserFault("sweep_variants", limit=VARIANTS_MOST - 1)
    if any(not code.strip() for code in codes):
        raise UserFault("training_reward_missing")
    ranges = {name: _range(algorithm, name, given) for name, given in hyperparameters.items()}
    space: SearchSpace = {"hyperparameters": ranges, "action_spaces": spaces, "reward_functions": codes}
    if combinations(space) < SETTINGS_LEAST:
        raise UserFault("sweep_space_empty")
    return space


def check_size(space: SearchSpace, settings: Any, budget_s: Any) -> None:
    """Raises UserFault ``sweep_settings``, ``sweep_combinations``, ``sweep_budget``."""
    if type(settings) is not int or not SETTINGS_LEAST <= settings <= SETTINGS_MOST:
        raise UserFault("sweep_settings", low=SETTINGS_LEAST, high=SETTINGS_MOST)
    if settings > (most := combinations(space)):
        raise UserFault("sweep_combinations", count=int(most))
    least = least_budget_s(settings)
    if type(budget_s) is not int or not least <= budget_s <= 86_400:
        raise UserFault("sweep_budget", low=least, high=86_400)


def least_budget_s(settings: int) -> int:
    return math.ceil(LEAST_S * settings * len(rungs_of(settings)))


def combinations(space: SearchSpace) -> float:
    """How many different settings the space has; infinite with a range of decimal numbers."""
    count: float = len(space["action_spaces"]) * len(space["reward_functions"])
    for name, values in space["hyperparameters"].items():
        if "choices" in values:
            count *= len(values["choices"])
        else:
            count *= values["high"] - values["low"] + 1 if is_whole(name) else math.inf
    return count


def dimensions(space: SearchSpace) -> Iterator[str]:
    """The names of what varies."""
    yield from space["hyperparameters"]
    if len(space["action_spaces"]) > 1:
        yield ACTION_SPACE
    if len(space["reward_functions"]) > 1:
        yield REWARD_FUNCTION


def value_in(setting: TrialSetting, dimension: str) -> float | str:
    if dimension == ACTION_SPACE:
        return setting["action_space"]
    if dimension == REWARD_FUNCTION:
        return setting["reward_function"]
    return setting["hyperparameters"][dimension]


def _range(algorithm: str, name: str, given: Mapping[str, Any]) -> SearchRange:
    """Raises UserFault ``training_hyperparameter...``, ``sweep_range``."""
    if not isinstance(given, Mapping):
        raise UserFault("sweep_range", name=str(name)[:40])
    rule = HYPERPARAMETERS.get(name)
    if given.keys() == {"choices"} and isinstance(given["choices"], Sequence) and not isinstance(given["choices"], str):
        values = [check_hyperparameters(algorithm, {name: value})[name] for value in given["choices"]]
        choices = list(dict.fromkeys(values))
        if len(choices) > 1:
            return {"choices": choices}
    elif given.keys() == {"low", "high"}:
        low, high = (check_hyperparameters(algorithm, {name: given[end]})[name] for end in ("low", "high"))
        if rule is not None and not rule.choices and low < high:
            if rule.sizes:
                return {"choices": [size for size in rule.sizes if low <= size <= high]}
            return {"low": low, "high": high}
    else:
        check_hyperparameters(algorithm, {name: None} if rule is None else {})
    raise UserFault("sweep_range", name=str(name)[:40])
