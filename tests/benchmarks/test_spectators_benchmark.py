"""The benchmark of spectators at its smallest, and what is a miss."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks import spectators
from tests.benchmarks.running import run


@pytest.mark.soak
def test_pages_are_asked_for_while_results_are_committed(tmp_path, new_data: Callable[[Path], Path]) -> None:
    ready = new_data(tmp_path / "data") / "paddock.sqlite3"
    arguments = ("--json", "--rate", "100", "--racers-rate", "50", "--seconds", "1", "--entries", "200")
    found = json.loads(run("benchmarks.spectators", *arguments, may_miss=True, BENCH_DATABASE=ready))
    pages = found["pages"]
    assert {name.split(",")[0] for name in pages} == {"a bare Django view", "guests", "racers"}
    assert all(page["failed"] == 0 and page["per_second"] > 0 for page in pages.values())
    assert {page["results_per_second"] > 0 for name, page in pages.items() if name.endswith("results")} == {True}
    racers = pages["racers, /races/board/, no writes"]
    assert racers["processor_ms"] > pages["a bare Django view, 50 a second"]["processor_ms"]
    assert spectators.table(found)


def figures(**changes: object) -> dict:
    """Figures of a page that keeps what is promised."""
    page = {"rate": 200, "per_second": 199, "failed": 0, "p50_ms": 9.0, "p95_ms": 100.0, "p99_ms": 120.0}
    page |= {"processor_ms": 4.0, "ratio": 2.5, "load": 0.5, **changes}
    return {"database": "sqlite", "entries": 1000, "cores": 2, "pages": {"racers, /, no writes": page}}


def test_a_page_at_its_rate_in_time_is_no_miss() -> None:
    assert spectators.misses(figures()) == []
    assert re.search(r"racers.* 200 +199 +9.0 +100.0 +120.0 +0 +4.0 +2.5 +0.5$", spectators.table(figures()))


@pytest.mark.parametrize("change", [{"p95_ms": 100.1}, {"failed": 1}, {"per_second": 150}])
def test_a_page_that_is_late_fails_or_is_answered_too_rarely_is_a_miss(change: dict) -> None:
    (found,) = spectators.misses(figures(**change))
    assert found.startswith("racers, /, no writes: ")
