"""The benchmark of the deadline hour at its smallest: what it measures, and what it calls a miss."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import deadline
from tests import postgres
from tests.benchmarks.running import run

SMALLEST = ("--json", "--students", "12", "--workers", "2")


def check(figures: dict, database: str) -> None:
    assert (figures["students"], figures["database"]) == (12, database)
    # each attempt drives two parts and the drawn track; so does the reference row
    assert (figures["attempts"], figures["runs"]) == (12, 13 * 3)
    assert (figures["complete_marks"], figures["late_marks"]) == (12, 0)
    assert figures["judged_s_after_the_deadline"] > 10
    assert figures["doubled"] == {"students": 20, "accepted": 20, "refused": 20}
    assert min(figures["hand_in_ms"].values()) > 0 and min(figures["run_end_ms"].values()) > 0
    assert "double clicks" in deadline.table(figures)


@pytest.mark.soak
def test_a_small_class_is_measured(tmp_path, new_data) -> None:
    ready = new_data(tmp_path / "data") / "paddock.sqlite3"
    check(json.loads(run("benchmarks.deadline", *SMALLEST, may_miss=True, BENCH_DATABASE=ready)), "sqlite")


@pytest.mark.soak
@pytest.mark.postgres
def test_a_small_class_is_measured_on_postgresql(postgresql: Path) -> None:
    ready = postgres.migrated(postgresql)
    found = run("benchmarks.deadline", *SMALLEST, "--postgres", may_miss=True, BENCH_DATABASE=ready)
    check(json.loads(found), "postgresql")


def test_each_broken_promise_is_a_miss() -> None:
    kept = {
        "students": 500,
        "complete_marks": 500,
        "late_marks": 0,
        "doubled": {"students": 20, "accepted": 20, "refused": 20},
        "hand_in_ms": {"ratio": 1.1},
        "run_end_ms": {"ratio": 2.0},
        "waited_by_foretold": 1.2,
    }
    assert deadline.misses(kept) == []
    broken = {
        "complete_marks": 499,
        "late_marks": 1,
        "doubled": {"students": 20, "accepted": 21, "refused": 19},
        "hand_in_ms": {"ratio": 2.1},
        "run_end_ms": {"ratio": 3.1},
        "waited_by_foretold": 2.1,
    }
    for name, value in broken.items():
        assert len(deadline.misses(kept | {name: value})) == 1, name
