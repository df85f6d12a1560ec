"""The benchmark of pages at its smallest: every page for every reader, a bare view beside it, and what is a miss."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks import pages
from tests import postgres
from tests.benchmarks.running import run


def check(figures: dict, database: str) -> None:
    rows = {(row["page"], row["reader"]): row for row in figures["pages"]}
    assert figures["database"] == database and figures["bare_ms"] > 0
    assert set(rows) == {("home", reader) for reader in pages.READERS["home"]} | {
        ("garage", reader) for reader in pages.READERS["garage"]
    }
    assert all(row["ratio"] > 1 and row["queries"] > 2 and row["bytes"] > 1000 for row in rows.values())
    guest = rows["home", "guest"]
    assert guest["shared_ms"] < guest["ms"]  # from memory
    assert "nothing committed" in pages.table(figures)


@pytest.mark.soak
def test_pages_are_measured_beside_a_bare_view(tmp_path, new_data: Callable[[Path], Path]) -> None:
    ready = new_data(tmp_path / "data") / "paddock.sqlite3"
    arguments = ("--json", "--runs", "1", "--pages", "home", "garage")
    check(json.loads(run("benchmarks.pages", *arguments, may_miss=True, BENCH_DATABASE=ready)), "sqlite")


@pytest.mark.soak
@pytest.mark.postgres
def test_pages_are_measured_on_postgresql(postgresql: Path) -> None:
    ready = postgres.migrated(postgresql)
    arguments = ("--postgres", "--json", "--runs", "1", "--pages", "home", "garage")
    check(json.loads(run("benchmarks.pages", *arguments, may_miss=True, BENCH_DATABASE=ready)), "postgresql")


def figures(**changes: object) -> dict:
    """Figures of a page that keeps what is promised."""
    row = {"page": "home", "reader": "results", "ms": 20.0, "ratio": 50.0, "queries": 20, "bytes": 9000}
    row |= {"shared_ms": 20.0, "shared_ratio": 10.0, "shared_queries": 8, "bare_ms": 2.0, **changes}
    machine = {"cores": 2, "load": [0.0, 0.0]}
    return {"database": "sqlite", "site": "the demo season", "bare_ms": 2.0, "pages": [row], "machine": machine}


def test_a_page_within_its_bounds_is_no_miss() -> None:
    assert pages.misses(figures()) == []
    assert re.search(r"home +results +20.0 +50.0 +20 +9,000 +20.0 +10.0 +8$", pages.table(figures()))
    assert pages.misses(figures(reader="guest", shared_ratio=50.0, shared_queries=20)) == []


@pytest.mark.parametrize("change", [{"shared_ratio": 10.1}, {"shared_queries": 9}])
def test_a_page_beyond_its_bounds_is_a_miss(change: dict) -> None:
    (found,) = pages.misses(figures(**change))
    assert found.startswith("home, results: ")
