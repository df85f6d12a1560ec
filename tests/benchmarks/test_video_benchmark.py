"""The benchmark of videos, as it is started by hand."""

from __future__ import annotations

import json

import pytest

from .running import run


@pytest.mark.slow
def test_a_second_of_a_run_becomes_a_video() -> None:
    figures = json.loads(run("benchmarks.video", "--json", "--seconds", "1", may_miss=True))
    assert figures["peak_mb"] > 0
