"""Rows that many tests begin with: made once for those that follow each other, not for each of them.

They are made within a transaction around the tests' own, and each test's own is rolled back, so that every test finds
them as they were made. When a test comes that does not ask for them, they are rolled back, too.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import pytest
from django.db import transaction

MADE: pytest.StashKey[dict[str, Kept]] = pytest.StashKey()


class Kept:
    """What ``make()`` made and returned, while tests ask for it; made anew for the first that asks when it is older
    than ``fresh_s``."""

    def __init__(
        self, make: Callable[[], Any], unblocked: Callable[[], AbstractContextManager[None]], fresh_s: float
    ) -> None:
        self._make, self._unblocked, self._fresh_s = make, unblocked, fresh_s
        self._around: transaction.Atomic | None = None
        self._made: Any = None
        self._at = 0.0

    def copy(self) -> Any:
        """What was made, for a test to change as it likes."""
        return copy.deepcopy(self._made)

    def have(self) -> None:
        """See to it that it is there, and fresh."""
        if self._around is not None and time.monotonic() - self._at < self._fresh_s:
            return
        self.drop()
        with self._unblocked():
            self._around = transaction.atomic()
            self._around.__enter__()
            self._made, self._at = self._make(), time.monotonic()

    def drop(self) -> None:
        """Roll it back, if it is there."""
        if self._around is None:
            return
        with self._unblocked():
            transaction.set_rollback(True)
            self._around.__exit__(None, None, None)
        self._around = self._made = None


def before(item: pytest.Item) -> None:
    """Before a test's own transaction begins: what it asks for is there, and nothing else."""
    kept = item.session.stash.get(MADE, {})
    asked = [name for name in kept if name in item.fixturenames]
    for name in kept.keys() - asked:
        kept[name].drop()
    for name in asked:
        kept[name].have()
