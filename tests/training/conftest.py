"""What tests of training share."""

from __future__ import annotations

import pytest

from training import tasks


@pytest.fixture
def training_bell(monkeypatch) -> list[dict]:
    """Every ring for the trainers, instead of a broker."""
    rings: list[dict] = []
    monkeypatch.setattr(tasks.train, "apply_async", lambda **options: rings.append(options))
    return rings
