"""What ``make test`` and ``make journeys`` leave to ``make soak``: more of the same, at seconds of a processor each.

One of each kind always stays. ``make soak`` runs what is marked ``soak`` and, with all their examples, what hypothesis
makes up (whose plugin marks it ``hypothesis``).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Hashable, Iterable
from typing import Any, TypeVar

import pytest

Case = TypeVar("Case")
SOAK = "PADDOCK_SOAK" in os.environ  # `make soak` sets it
FEWER = 5


def one_of_each(cases: Iterable[Case], kind: Callable[[Case], Hashable]) -> list:
    """Parameters: the first case of each kind for every run of the tests, the others for ``make soak``."""
    seen: set[Hashable] = set()
    parameters = []
    for case in cases:
        parameters.append(_parameter(case, pytest.mark.soak if kind(case) in seen else ()))
        seen.add(kind(case))
    return parameters


def only(always: Collection[Case], cases: Iterable[Case]) -> list:
    """Parameters: the cases of ``always`` for every run of the tests, the others for ``make soak``."""
    cases = list(cases)
    assert all(case in cases for case in always), "a case that is none"
    return [_parameter(case, () if case in always else pytest.mark.soak) for case in cases]


def some(cases: Iterable[Case], step: int = 5) -> list:
    """Parameters: the first case and every ``step``-th after it for every run of the tests, the others for ``make
    soak``: where one code meets many data."""
    return [_parameter(case, pytest.mark.soak if number % step else ()) for number, case in enumerate(cases)]


def examples(count: int) -> int:
    """How many examples hypothesis makes up: all of ``count`` in ``make soak``, a fifth of them otherwise."""
    return count if SOAK else max(3, count // FEWER)


def _parameter(case: object, marks: Any) -> object:
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, marks=[*case.marks, marks] if marks else case.marks, id=case.id)
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=marks)
