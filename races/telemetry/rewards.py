"""Rewards along a lap: rooms above register what knows the reward functions of runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from django.contrib.auth.models import AnonymousUser

from accounts.models import Racer
from evaluation.models import Evaluation


@dataclass(frozen=True)
class RewardFunction:
    """``key``: names the function and all else that its rewards depend on beside the run's trace. ``along``: a lap's
    number to its rewards by the trace's rows; it may take seconds, and raises PaddockError."""

    key: str
    along: Callable[[int], dict[int, float]]


# Which of some finished runs have a reward function that a racer may read, by their keys.
SOURCES: list[Callable[[Sequence[Evaluation], Racer], dict[int, RewardFunction]]] = []


def reward_functions(runs: Sequence[Evaluation], reader: Racer | AnonymousUser) -> dict[int, RewardFunction]:
    """The reward functions of runs that the reader may read, by the runs' keys."""
    if isinstance(reader, AnonymousUser):
        return {}
    return {key: function for source in SOURCES for key, function in source(runs, reader).items()}
