"""Each race type through the sandbox: one result on every run, on one core, and while the other cores are busy."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

import pytest

from evaluation.running.pipeline import EvaluationOutcome, RaceJob, RivalModel, evaluate
from evaluation.sandbox.probe import probe
from league.house_cars.services import house_cars
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import BoxPlace, RaceRules
from tests.sandbox.conftest import nothing_left  # noqa: F401
from tests.soak import SOAK, only

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("nothing_left")]
RUNS = 5 if SOAK else 2
CARS = [RivalModel(car.onnx.read_bytes(), json.loads(car.metadata.read_bytes())) for car in house_cars()]
FIXED = tuple(BoxPlace(fraction, lane) for fraction, lane in ((0.2, "inner"), (0.5, "outer"), (0.8, "inner")))
RACES = {
    "boxes in drawn places": (RaceRules(race_type="object_avoidance", random_boxes=6, seed=3, laps=1), 0),
    "boxes in fixed places": (RaceRules(race_type="object_avoidance", boxes=FIXED, laps=1), 0),
    "bots": (RaceRules(race_type="head_to_head", bots=4, bot_lane_changes=True, seed=3, laps=1), 0),
    "a duel": (RaceRules(race_type="head_to_head", laps=1), 1),
    "four cars": (RaceRules(race_type="head_to_head", laps=1), 3),
}


@pytest.fixture(params=only(("boxes in drawn places", "four cars"), RACES))
def job(request):
    rules, rivals = RACES[request.param]
    first, *others = (CARS * 4)[: rivals + 1]
    return RaceJob(by_slug("oval").geometry(), rules, first.onnx, first.metadata, tuple(others))


def digest(outcome: EvaluationOutcome) -> str:
    """One number for everything but what it took: laps, metrics, traces, places of bots, order."""
    kept = {name: value for name, value in asdict(outcome).items() if name not in ("wall_s", "shares", "peak_mb")}
    return hashlib.sha256(json.dumps(kept, default=bytes.hex, sort_keys=True).encode()).hexdigest()


@contextmanager
def one_core_only() -> Iterator[None]:
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def busy_cores() -> Iterator[None]:
    """Every core but the first computes something else."""
    burners = [
        subprocess.Popen([sys.executable, "-c", f"import os; os.sched_setaffinity(0, {{{core}}})\nwhile True: pass"])
        for core in sorted(os.sched_getaffinity(0))[1:]
    ]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def test_levels_and_busy_cores_do_not_change_the_result(job):
    levels = [*range(2, probe().level + 1)] * RUNS
    results = [evaluate(job, level=level) for level in levels[:RUNS]]
    with one_core_only():
        results.append(evaluate(job))
    with busy_cores():
        results.append(evaluate(job))
    assert len({digest(outcome) for outcome in results}) == 1
    outcome = results[0]
    assert outcome.laps and outcome.retired is None
    assert len(outcome.layout["bots"]) == job.rules.bots
    assert all(len(path) == outcome.trace_csv.count(b"\n") - 1 for path in outcome.layout["bots"])
    assert len(outcome.layout["boxes"]) == len(job.rules.boxes) + job.rules.random_boxes
    assert sorted(outcome.order) == list(range(1 + len(job.rivals)))


def test_another_seed_places_the_boxes_elsewhere():
    car, (rules, _) = CARS[0], RACES["boxes in drawn places"]
    drawn = [RaceRules(**{**vars(rules), "seed": seed}) for seed in (3, 4)]
    places = [evaluate(RaceJob(by_slug("oval").geometry(), one, car.onnx, car.metadata)) for one in drawn]
    assert places[0].layout != places[1].layout
