"""Checks of reward functions for pages and API: one at a time for each racer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypedDict

from django.core.cache import cache

from core.forms import explain
from paddock.errors import PaddockError, PlatformFault, UserFault

if TYPE_CHECKING:
    from accounts.models import Racer

    from .validation import Problem, Report

CHECK_LOCK_S = 90  # longer than a check may take, with its wait for a slot


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


def checked(owner: Racer, code: str, race_type: str) -> Report:
    """The report of the sandbox on a reward function. Raises UserFault ``reward_check_runs``, and what
    :func:`training.rewards.validation.check_reward` raises."""
    from .validation import check_reward  # imports the simulator, which no other page needs

    with one_check(owner):
        return check_reward(code.replace("\r\n", "\n"), race_type=race_type)


def refusals(owner: Racer, code: str, race_type: str) -> list[UserFault]:
    """The problems of a reward function as faults. Raises as :func:`checked`."""
    return [problem.fault for problem in checked(owner, code, race_type).problems]


class ProblemDocument(TypedDict):
    """A problem or a warning, as pages and the API show it."""

    line: int | None
    kind: str
    code: str
    message: str


def described_refusal(fault: PaddockError) -> tuple[ProblemDocument, int]:
    """Why nothing was checked, as a problem, and the HTTP status."""
    status = 503 if isinstance(fault, PlatformFault) else 409
    return {"line": None, "kind": "", "code": fault.code, "message": explain(fault)}, status


def described(problem: Problem) -> ProblemDocument:
    """The problem with its sentence in the reader's language."""
    return {"line": problem.line, "kind": problem.kind, "code": problem.code, "message": explain(problem.fault)}
