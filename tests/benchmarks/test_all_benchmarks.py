"""``make bench``: every part is measured and told in one object, also where one cannot be; and what a season costs."""

from __future__ import annotations

import importlib
import json
import re

import pytest

from benchmarks import __main__ as everything
from benchmarks import season
from tests.shared import CHECKOUT


@pytest.mark.soak
def test_requested_parts_and_failures_come_as_one_object(monkeypatch, capsys, tmp_path, new_data):
    monkeypatch.setenv("BENCH_DATABASE", str(new_data(tmp_path / "data") / "paddock.sqlite3"))
    monkeypatch.setitem(everything.PARTS, "season", ("season", (), ("--results", "300,900")))
    monkeypatch.setitem(everything.PARTS, "board", ("board", (), ("--sizes", "many")))
    assert everything.main(["--quick", "--parts", "season", "board"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"season", "board"}
    assert found["season"]["figures"]["made_up"][1]["results"] > 900
    assert found["season"]["seconds"] > 0 and isinstance(found["season"]["missed"], list)
    assert "argument --sizes: invalid" in found["board"]["error"]


def test_every_part_is_a_program_with_its_options() -> None:
    for part, (module, full, quick) in everything.PARTS.items():
        loaded = importlib.import_module(f"benchmarks.{module}")
        known = set(re.findall(r'"(--[a-z-]+)"', (CHECKOUT / f"benchmarks/{module}.py").read_text()))
        assert {one for one in (*full, *quick) if one.startswith("--")} <= known and loaded.main, part


def test_make_bench_runs_every_part() -> None:
    assert re.search(
        r"^bench:.*\n\t@\$\(BIN\)/python -m benchmarks \$\(BENCH_ARGS\)$", (CHECKOUT / "Makefile").read_text(), re.M
    )


def test_a_slow_or_fast_growing_season_is_a_miss() -> None:
    one = {"results": 1000, "races": 27, "seconds": 61.0, "processor_s": 1.0}
    figures = {"database": "sqlite", "made_up": [one | {"seconds": 1.0}, one], "growth": 1.6, "recorded": None}
    assert len(season.misses(figures)) == 2 and "1,000 results of 27 races" in season.table(figures)
