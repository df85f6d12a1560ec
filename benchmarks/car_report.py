"""``python -m benchmarks.car_report [--json]``: a car's report, a hundred variations of a lap of the oval on one core.

Sandboxed as on the site (the network in one process, the referee in another) and cut into the same chunks, one after
the other, with the start of every process: what one worker needs. Nothing is kept ready.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from evaluation.reports import MOST_IN_CHUNK
from evaluation.reports.grading import DrivenLap, robustness_of
from evaluation.running.drives import DriveJob, DriveOutcome, LapDrive, drive_all
from evaluation.running.race_setup import Venue
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.rules.report import VARIATIONS
from paddock.simulator.randomisation import variations

from .machine import measured_on
from .models import CONSOLE, AdmittedCar, admitted, cars
from .processor import Clock
from .report import command, report
from .whole import pin_to_one_core

MOST_S = 60.0  # for a house car


def run(*, track: str, seed: int, names: list[str] | None = None) -> dict[str, Any]:
    """All figures as JSON values. ``names``: only these cars."""
    load = os.getloadavg()[0]
    found = {}
    for car in cars():
        if (names is None and car.name == CONSOLE) or (names is not None and car.name not in names):
            continue
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            found[car.name] = pool.submit(_measure, admitted(car), track, seed).result()
    if not found:
        raise SystemExit("there is no such car to measure")
    return {"machine": measured_on(load), "track": track, "variations": VARIATIONS, "seed": seed, "cars": found}


def _measure(car: AdmittedCar, slug: str, seed: int) -> dict[str, Any]:
    pin_to_one_core()
    track = by_slug(slug).geometry()
    venue = Venue(track, track.direction, "official")
    drives = [LapDrive(one.number, venue, one) for one in variations(seed, track.length)]
    began, cpu_s = time.monotonic(), 0.0
    outcomes: list[DriveOutcome] = []
    for at in range(0, len(drives), MOST_IN_CHUNK):
        chunk = tuple(drives[at : at + MOST_IN_CHUNK])
        job = DriveJob(car.onnx, car.metadata, car.facts, chunk)
        clock = Clock()  # it looks for the processes once: each chunk has its own
        outcomes += drive_all(job, on_progress=clock.look).drives
        cpu_s += clock.seconds
        clock.close()
    wall_s = time.monotonic() - began
    laps = [
        DrivenLap(
            number=one.number,
            track=track.fingerprint,
            direction=track.direction,
            variation=one.number,
            complete=one.complete,
            time_ms=one.time_ms,
            percent=one.percent,
            trace_sha256=one.trace_sha256,
        )
        for one in outcomes
    ]
    robustness = robustness_of(laps)
    assert robustness is not None
    simulated_s = sum(lap.time_ms for lap in laps) / 1000.0
    return {
        "wall_s": round(wall_s, 2),
        "cpu_s": round(cpu_s, 2),
        "simulated_s": round(simulated_s, 1),
        "real_time_factor": round(simulated_s / wall_s, 1),
        "completed": robustness.overall.completed,
        "spread_permille": robustness.overall.spread_permille,
        "grade": robustness.grade,
    }


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [
        f"{machine['cpu']}, one core of {machine['cores']}, load {machine['load_before']} to {machine['load_after']}; "
        f"{machine['engine']}; {figures['variations']} variations of a lap of {figures['track']}, sandboxed",
        "",
        f"{'':12}{'wall':>9}{'CPU':>9}{'x real time':>13}{'completed':>11}{'spread':>9}{'grade':>7}",
    ]
    for name, car in figures["cars"].items():
        spread = "–" if car["spread_permille"] is None else f"{car['spread_permille'] / 10:.1f} %"
        lines.append(
            f"{name:12}{car['wall_s']:>7.1f} s{car['cpu_s']:>7.1f} s{car['real_time_factor']:>13.1f}"
            f"{car['completed']:>11}{spread:>9}{car['grade']:>7}"
        )
    return "\n".join(lines)


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that these figures break, one sentence each."""
    return [
        f"{name} takes {car['wall_s']:.1f} s, {MOST_S:g} s are promised"
        for name, car in figures["cars"].items()
        if name != CONSOLE and figures["track"] == "oval" and car["wall_s"] > MOST_S
    ]


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; 1 where a promise is missed."""
    parser = command("car_report", "A car's report on one core.")
    parser.add_argument("--track", default="oval", choices=[entry.slug for entry in CATALOGUE if not entry.is_open])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--models", nargs="+", metavar="NAME", help="only these cars; default: the house cars")
    options = parser.parse_args(arguments)
    figures = run(track=options.track, seed=options.seed, names=options.models)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
