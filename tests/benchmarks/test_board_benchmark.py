"""The benchmark of boards at its smallest: what it measures, what it calls a miss, and what is drawn of it."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from benchmarks import board, curves, load
from tests import postgres
from tests.benchmarks.running import run

SMALLEST = ("--json", "--sizes", "120,400", "--runs", "1", "--closed", "100")
NAMES = {*board.PAGES, "recorded result"}


def check(figures: dict, database: str) -> None:
    assert (figures["sizes"], figures["close"]["entries"], figures["database"]) == ([120, 400], 100, database)
    assert set(figures["looks"]) == NAMES and set(figures["queries"]) == set(board.PAGES)
    for look in figures["looks"].values():
        assert min(look["ms"]) > 0 and look["ratio"] == pytest.approx(look["ms"][1] / look["ms"][0])
    assert all(1 <= count <= board.QUERIES for count in figures["queries"].values())
    assert 0 < figures["close"]["processor_s"] < board.CLOSING_S
    missed = [name for name, look in figures["looks"].items() if look["ratio"] > board.RATIO]
    assert len(board.misses(figures)) == len(missed)
    assert "closing 100 entries" in board.table(figures)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory, new_data: Callable[[Path], Path]) -> dict:
    """What one run on SQLite finds, with a second of load where there is something to make it with."""
    ready = new_data(tmp_path_factory.mktemp("board") / "data") / "paddock.sqlite3"
    loaded = ("--load", "1" if load.is_there() else "0", "--turns", "1")
    return json.loads(run("benchmarks.board", *SMALLEST, *loaded, may_miss=True, BENCH_DATABASE=ready))


@pytest.mark.soak
def test_each_board_size_and_the_closing_of_a_month_are_measured(measured) -> None:
    check(measured, "sqlite")


@pytest.mark.soak
@pytest.mark.skipif(not load.is_there(), reason="wrk is not installed")
def test_requests_per_second_are_compared_with_a_bare_view(measured) -> None:
    found = measured["requests"]
    assert set(found) == {load.BARE, "page of 120", "page of 400", "API of 120", "API of 400"}
    for one in found.values():
        assert one["per_second"] > 0 and one["per_processor_second"] > 0
    assert found[load.BARE]["per_processor_second"] > found["page of 400"]["per_processor_second"]
    assert load.BARE in board.table(measured)


@pytest.mark.soak
@pytest.mark.postgres
def test_boards_are_measured_on_postgresql(postgresql: Path) -> None:
    ready = postgres.migrated(postgresql)
    arguments = ("--postgres", *SMALLEST, "--load", "0")
    check(json.loads(run("benchmarks.board", *arguments, may_miss=True, BENCH_DATABASE=ready)), "postgresql")


def test_a_missing_wrk_is_noticed_before_measuring(monkeypatch, capsys) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)

    with pytest.raises(SystemExit) as ended:
        board.main([])

    assert ended.value.code == 2 and load.MISSING in capsys.readouterr().err


def figures(**changes: object) -> dict:
    """Figures that keep every promise."""
    return {
        "database": "sqlite",
        "sizes": [1000, 1_000_000],
        "looks": {name: {"ms": [2.0 + n, 2.1 + n], "ratio": (2.1 + n) / (2.0 + n)} for n, name in enumerate(NAMES)},
        "queries": dict.fromkeys(board.PAGES, 12),
        "close": {"entries": 100_000, "seconds": 29.0, "processor_s": 20.0},
        "requests": None,
        "machine": {"cores": 2, "load": [0.0, 0.0]},
    } | changes


def test_figures_that_keep_every_promise_have_no_miss() -> None:
    assert board.misses(figures()) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"looks": {"one rank": {"ms": [1.0, 1.6], "ratio": 1.6}}}, "one rank: 1.60 times from 1,000 to 1,000,000"),
        ({"queries": {"API page": 13}}, "API page: 13 queries"),
        ({"close": {"entries": 100_000, "seconds": 31.0}}, "closing 100,000 entries took 31 s"),
    ],
)
def test_a_broken_promise_is_named(change: dict, said: str) -> None:
    (found,) = board.misses(figures(**change))

    assert said in found


def test_curves_have_a_panel_for_each_database(tmp_path) -> None:
    for name in ("sqlite", "postgresql"):
        (tmp_path / f"{name}.json").write_text(json.dumps(figures(database=name)))
    out = tmp_path / "curves.svg"

    assert curves.main([*(str(tmp_path / f"{name}.json") for name in ("sqlite", "postgresql")), str(out)]) == 0

    picture = ElementTree.parse(out).getroot()
    texts = [element.text for element in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert {"SQLite", "PostgreSQL", "1,000", "1,000,000"} <= set(texts)
    assert sum(bool(re.search(r" ×1\.0\d$", text)) for text in texts) == 2 * len(NAMES)
    heights = sorted(
        float(element.get("y"))
        for element in picture.iter("{http://www.w3.org/2000/svg}text")
        if "×" in element.text and float(element.get("x")) < curves.WIDTH
    )
    assert all(below - above >= curves.LINE_PX - 0.2 for above, below in pairwise(heights))


def test_drawing_needs_input_files_and_an_output_file(capsys) -> None:
    assert curves.main(["only.svg"]) == 2 and curves.main(["a.json", "b.json"]) == 2
    assert "usage" in capsys.readouterr().err
