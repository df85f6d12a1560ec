"""What Optuna decides of a sweep: the next setting, and which trials continue. Only trainers import this module.

The database has the state; each call builds a study in memory from it."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import TrialState, create_trial

from ..models.sweep import SearchRange, SearchSpace, TrialSetting
from .halving import REDUCTION
from .space import ACTION_SPACE, REWARD_FUNCTION, is_whole

optuna.logging.set_verbosity(optuna.logging.WARNING)
RANDOM_FIRST = 3  # settings before the sampler has learned anything
_TRIES, _RANDOM_AFTER = 200, 10  # for a setting that no trial has
_LOGARITHMIC = 10.0  # a range whose ends differ by this factor


def suggest(space: SearchSpace, trials: Sequence[tuple[TrialSetting, float | None]], *, seed: int) -> TrialSetting:
    """The next setting, after the trials so far with their scores (None: failed). The same arguments give the same
    setting."""
    distributions = distributions_of(space)
    known = [_params(setting, distributions) for setting, _ in trials]
    params: dict[str, Any] = {}
    for attempt in range(_TRIES):
        first = RANDOM_FIRST if attempt < _RANDOM_AFTER else len(trials) + 1
        sampler = optuna.samplers.TPESampler(seed=seed + 1009 * len(trials) + attempt, n_startup_trials=first)
        study = optuna.create_study(direction="maximize", sampler=sampler)
        for had, (_, score) in zip(known, trials, strict=True):
            state = TrialState.FAIL if score is None else TrialState.COMPLETE
            with suppress(ValueError):  # the base settings may lie outside of the ranges
                study.add_trial(create_trial(params=had, distributions=distributions, value=score, state=state))
        params = study.ask(distributions).params
        if params not in known:
            break
    named = {name: value for name, value in params.items() if name not in (ACTION_SPACE, REWARD_FUNCTION)}
    return {
        "hyperparameters": named,
        "action_space": params.get(ACTION_SPACE, 0),
        "reward_function": params.get(REWARD_FUNCTION, 0),
    }


def continuing(scores: Sequence[float]) -> list[int]:
    """The indexes of the best third of the scores, at least one, by Optuna's pruner; of equal ones the earlier."""
    places = sorted(range(len(scores)), key=lambda index: (-scores[index], index))
    ranks = {index: float(len(scores) - place) for place, index in enumerate(places)}
    return [index for index in range(len(scores)) if not _prunes(ranks, index)]


def _prunes(ranks: dict[int, float], judged: int) -> bool:
    """Whether the pruner stops this trial once all others have reported: it compares a trial with those before it."""
    pruner = optuna.pruners.SuccessiveHalvingPruner(min_resource=1, reduction_factor=REDUCTION)
    study = optuna.create_study(direction="maximize", pruner=pruner)
    verdict = False
    for index in sorted(ranks, key=lambda index: index == judged):
        trial = study.ask()
        trial.report(ranks[index], step=1)
        verdict = trial.should_prune()
    return verdict


def distributions_of(space: SearchSpace) -> dict[str, BaseDistribution]:
    found: dict[str, BaseDistribution] = {
        name: _distribution(name, values) for name, values in space["hyperparameters"].items()
    }
    for name, choices in ((ACTION_SPACE, space["action_spaces"]), (REWARD_FUNCTION, space["reward_functions"])):
        if len(choices) > 1:
            found[name] = CategoricalDistribution(list(range(len(choices))))
    return found


def _distribution(name: str, values: SearchRange) -> BaseDistribution:
    if "choices" in values:
        return CategoricalDistribution(values["choices"])
    low, high = values["low"], values["high"]
    if is_whole(name):
        return IntDistribution(int(low), int(high))
    return FloatDistribution(low, high, log=low > 0 and high / low >= _LOGARITHMIC)


def _params(setting: TrialSetting, distributions: dict[str, BaseDistribution]) -> dict[str, float | str]:
    every = {
        **setting["hyperparameters"],
        ACTION_SPACE: setting["action_space"],
        REWARD_FUNCTION: setting["reward_function"],
    }
    return {name: every[name] for name in distributions}
