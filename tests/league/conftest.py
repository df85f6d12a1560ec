"""The league's tests ring nobody's bell; the folder of a small record."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.league.histories import write_season
from tests.league.records import FEW


@pytest.fixture(autouse=True)
def _no_broker(bell: list[dict]) -> None:
    """Submissions ring the bell; no test here needs a worker to hear it."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_season(tmp_path / "record", FEW)
