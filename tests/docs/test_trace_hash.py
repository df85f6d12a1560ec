"""The page's recipe for the hash of a trace: somebody who has the CSV alone comes to the same."""

from __future__ import annotations

import re

import pytest

from evaluation.running.pipeline import RaceJob, evaluate
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.trace import COLUMNS, STATUSES, Row, Trace
from training.golden.cars import car

from .pages import code_blocks, section, text

PAGE = section(text("simulator.md"), "### The hash of a trace")


@pytest.fixture
def trace_sha256():
    """The page's own program."""
    (code,) = code_blocks(PAGE, "python")
    names: dict = {"__name__": "recipe"}
    exec(code, names)
    return names["trace_sha256"]


def test_the_recipe_computes_the_hash_of_a_run(trace_sha256, tmp_path):
    drifter = car("drifter")  # continuous commands, off the road
    track = by_slug("kuei-super-raceway").geometry()
    outcome = evaluate(RaceJob(track, RaceRules(max_simulated_ms=5000), drifter.onnx, drifter.metadata))
    file = tmp_path / "0-iteration.csv"
    file.write_bytes(outcome.trace_csv)
    assert b"off_track" in outcome.trace_csv and b"pause" in outcome.trace_csv
    assert trace_sha256(file) == outcome.trace_sha256
    file.write_bytes(outcome.trace_csv.replace(b"0.0,", b"0.5,", 1))
    assert trace_sha256(file) != outcome.trace_sha256


def test_the_recipe_handles_every_status_and_odd_numbers(trace_sha256, tmp_path):
    odd = [1e-300, -0.0, 1 / 3, 123456789.123456789]
    rows = [
        Row(0, step, odd[step % 4], -odd[step % 4], 0.1, 0, 1.0, -1, 0.0, step % 2 == 0, True, 1.5, 7, 18.0, step / 15,
            status, 0.0, 2, step / 15)
        for step, status in enumerate(STATUSES)
    ]  # fmt: skip
    trace = Trace.of(rows)
    file = tmp_path / "trace.csv"
    file.write_bytes(trace.to_csv())
    assert trace_sha256(file) == trace.sha256


def test_the_page_names_the_type_of_every_column():
    named = {
        column: kind.replace("\\", "")
        for columns, kind in re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| `(.+?)` \|", PAGE, re.M)
        for column in re.findall(r"`(\w+)`", columns)
    }
    types = {name: column.dtype.str for name, column in Trace.of([]).columns.items()}
    assert types == {name: named.get(name, "<f8") for name in COLUMNS}
