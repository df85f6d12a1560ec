"""The benchmark of the queue at its smallest: what it measures, and what it calls a miss."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import queue
from tests import postgres
from tests.benchmarks.running import run

SMALLEST = ("--json", "--sizes", "200,4000", "--runs", "3")
NAMES = {"place of the first", "place of the last", "sweep", "claim", "submission"}


def check(figures: dict, database: str) -> None:
    assert (figures["sizes"], figures["database"]) == ([200, 4000], database)
    assert set(figures["looks"]) == {f"{name}, {racers} racers" for name in NAMES for racers in ("few", "many")}
    for look in figures["looks"].values():
        assert min(look["ms"]) > 0 and look["ratio"] == pytest.approx(look["ms"][1] / look["ms"][0])
    # what grew with the queue would be twenty times here; the least of them all cannot be noise
    assert min(look["ratio"] for name, look in figures["looks"].items() if "place" in name) < 4
    assert "place of the last, many racers" in queue.table(figures)


@pytest.mark.soak
def test_every_queue_length_is_measured(tmp_path, new_data) -> None:
    ready = new_data(tmp_path / "data") / "paddock.sqlite3"
    check(json.loads(run("benchmarks.queue", *SMALLEST, may_miss=True, BENCH_DATABASE=ready)), "sqlite")


@pytest.mark.soak
@pytest.mark.postgres
def test_every_queue_length_is_measured_on_postgresql(postgresql: Path) -> None:
    ready = postgres.migrated(postgresql)
    found = run("benchmarks.queue", *SMALLEST, "--postgres", may_miss=True, BENCH_DATABASE=ready)
    check(json.loads(found), "postgresql")


def test_growing_or_excessive_times_are_a_miss() -> None:
    looks = {"claim": {"ms": [1.0, 6.0], "ratio": 6.0}, "sweep": {"ms": [1.0, 1.1], "ratio": 1.1}}
    assert queue.misses({"sizes": [1000, 100_000], "looks": looks}) == [
        "claim: 6.0 ms at 100,000 waiting",
        "claim: 6.00 times from 1,000 to 100,000 waiting",
    ]
