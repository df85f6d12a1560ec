"""The benchmark of comparisons at its smallest, and what is a miss."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks import comparing
from benchmarks.load import BARE
from tests.benchmarks.running import run


@pytest.mark.soak
def test_eight_runs_are_opened_by_one_and_by_several(tmp_path, new_data: Callable[[Path], Path]) -> None:
    ready = new_data(tmp_path / "data") / "paddock.sqlite3"
    arguments = ("--json", "--people", "4", "--pause", "1", "--turns", "1")
    found = json.loads(run("benchmarks.comparing", *arguments, may_miss=True, BENCH_DATABASE=ready))
    assert set(found["pages"]) == {comparing.COLD, comparing.WARM, comparing.RACE}
    assert all(page["frame_ms"] > 0 and page["kb"] > 0 for page in found["pages"].values())
    assert found["at_once"]["opened"] == 4 * comparing.ROUNDS
    assert found["at_once"]["processor_ms"] > found[BARE]
    assert comparing.table(found)


def figures(p95: float = 900.0, **changes: float) -> dict:
    """Figures that keep what is promised."""
    page = {"frame_ms": 900.0, "browser_ms": 500.0, "server_ms": 100.0, "kb": 140.0, "answers": 21, "of_race": 1.5}
    waited = {"page": {"p50_ms": 100.0, "p95_ms": p95}}
    once = {"opened": 150, "processor_ms": 120.0, "of_bare": 130, "waited": waited}
    pages = {comparing.COLD: page, comparing.WARM: page | changes}
    return {"people": 50, "pause_s": 10.0, "cores": 2, "load": 0.5, "pages": pages, "at_once": once}


def test_a_quick_light_page_is_no_miss() -> None:
    assert comparing.misses(figures()) == []
    assert "p95    900.0 ms" in comparing.table(figures())


@pytest.mark.parametrize("change", [{"frame_ms": 1001.0}, {"kb": 200.0}, {"of_race": 2.5}, {"p95": 1001.0}])
def test_a_late_or_heavy_page_is_a_miss(change: dict) -> None:
    assert len(comparing.misses(figures(**change))) == 1
