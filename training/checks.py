"""Checks of reward functions for people who wait for the answer: one at a time for each racer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from django.core.cache import cache

from paddock.errors import UserFault

if TYPE_CHECKING:
    from accounts.models import Racer

CHECK_LOCK_S = 30


@contextmanager
def one_check(owner: Racer) -> Iterator[None]:
    """One check of a racer at a time: each takes a process and up to five seconds of a core. Raises UserFault
    ``reward_check_runs``."""
    key = f"reward-check-{owner.pk}"
    if not cache.add(key, 1, CHECK_LOCK_S):
        raise UserFault("reward_check_runs")
    try:
        yield
    finally:
        cache.delete(key)


def refusals(owner: Racer, code: str, race_type: str) -> list[UserFault]:
    """What is wrong with a reward function, as the sandbox finds it. Raises UserFault ``reward_check_runs`` and what
    :func:`training.rewards.validate.check_reward` raises."""
    # brings the physics along, which no other page needs
    from training.rewards.validate import validate_reward

    with one_check(owner):
        problems = validate_reward(code, race_type=race_type)
    return [UserFault(problem.code, **problem.params) for problem in problems]
