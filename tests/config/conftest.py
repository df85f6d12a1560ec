"""The tests of the whole site send no wake-ups."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _no_broker(wakes: list[dict]) -> None:
    """Submissions send wake-ups; no test here needs a worker to take them."""
