"""Where the golden runs' cars are, the console's among them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.shared import CONSOLE_CAR
from training.golden.__main__ import console_car
from training.golden.runs import CONSOLE


@pytest.fixture(scope="session")
def paths() -> Iterator[dict[str, str]]:
    """The console's car by its path, where somebody has its archive."""
    if not CONSOLE_CAR.is_file():
        yield {}
        return
    with console_car(CONSOLE_CAR) as path:
        yield {CONSOLE: path}
