"""What ``make test`` leaves to ``make soak``: more of the same, at seconds of a processor each."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import TypeVar

import pytest

Case = TypeVar("Case")


def one_of_each(cases: Iterable[Case], kind: Callable[[Case], Hashable]) -> list:
    """Parameters: the first case of each kind for every run of the tests, the others for ``make soak``."""
    seen: set[Hashable] = set()
    parameters = []
    for case in cases:
        parameters.append(pytest.param(case, marks=pytest.mark.soak if kind(case) in seen else ()))
        seen.add(kind(case))
    return parameters
