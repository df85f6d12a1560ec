"""``python -m benchmarks.processors [--json]``: whether a result is the same on every processor, and what that costs.

The house cars drive six tracks here and as other processors under qemu-user; traces and lap times are compared. Here,
each decision is then looked at: how often float64 had to be asked, how much of its bound the error of float32 ever
used, and how much longer a run takes than if the runtime's answer were taken as it is.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from paddock.geometry.catalogue import CATALOGUE
from paddock.network.policy_wire import EXACT, EXCEEDED
from paddock.rules.race import RaceRules
from training.golden.__main__ import console_car
from training.golden.drive import Driven
from training.golden.processors import BARE, NATIVE, PROCESSORS, ProcessorFailed, emulator, side_by_side
from training.golden.runs import CONSOLE, GoldenRun

from .machine import measured_on
from .models import CONSOLE_CAR
from .report import command, report

HOUSE_CARS = ("brisk", "steady", "flyer")
LAPS = 3
# Of the old console's catalogue, where its files lie beside the checkout; else of our own
COMMUNITY = ("dubai_open", "Vegas_track", "reInvent2019_wide", "Spain_track", "morgan_open", "red_star_open")
TRACKS = Path(__file__).resolve().parent.parent.parent / "shared" / "tracks"
CONSOLE_MS = 30_000
LIMIT_S = 3600.0
MOST_COST = {CONSOLE: 1.03, "flyer": 1.15}  # of a run's time, for decisions that are the same everywhere
MOST_BOUND_USED = 1.0


def tracks() -> list[str]:
    """Six tracks, as :class:`training.golden.runs.GoldenRun` names them."""
    files = [TRACKS / f"{name}.npy" for name in COMMUNITY]
    if all(file.is_file() for file in files):
        return list(map(str, files))
    return [entry.slug for entry in CATALOGUE][: len(COMMUNITY)]


def run(*, names: Sequence[str], laps: int, processors: Sequence[str]) -> dict[str, Any]:
    """All figures as JSON values. Raises ProcessorFailed."""
    load = os.getloadavg()[0]
    runs = [
        GoldenRun(f"{car} on {Path(track).stem}", track, RaceRules(laps=laps), (car,))
        for track in names
        for car in HOUSE_CARS
    ]
    native, *others = _drive([NATIVE, *processors], runs)
    found = {name: _compared(native, driven) for name, driven in zip(processors, others, strict=True)}
    with contextlib.ExitStack() as stack:
        looked_at = list(runs)
        if CONSOLE_CAR.is_file():
            path = stack.enter_context(console_car(CONSOLE_CAR))
            rules = RaceRules(laps=laps, max_simulated_ms=CONSOLE_MS)
            looked_at += [GoldenRun(f"{CONSOLE} on {Path(track).stem}", track, rules, (path,)) for track in names]
        with side_by_side([NATIVE], looked_at, LIMIT_S, "benchmarks.decisions") as (process,):
            decided = process.answers()
    by_car: dict[str, list[dict[str, Any]]] = {}
    for each, figures in zip(looked_at, decided, strict=True):
        by_car.setdefault(Path(each.cars[0]).name, []).append(figures)
    return {
        "machine": measured_on(load),
        "race": {"tracks": [Path(track).stem for track in names], "laps": laps},
        "processors": [NATIVE, *processors],
        "runs": sum(one["runs"] for one in found.values()),
        "equal": sum(one["equal"] for one in found.values()),
        "by_processor": found,
        "steps": {car: sum(sum(one["ways"]) for one in each) for car, each in by_car.items()},
        "slow_steps": {car: _share(each) for car, each in by_car.items()},
        "bound_used": {car: max((one["bound_used"] or 0.0) for one in each) for car, each in by_car.items()},
        "cost": {car: _ratio(each, "rest_s") for car, each in by_car.items()},
        "network_cost": {car: _ratio(each) for car, each in by_car.items()},
    }


def _drive(processors: Sequence[str], runs: Sequence[GoldenRun]) -> list[list[Driven]]:
    """What the runs came to on each processor; as many at a time as there are cores."""

    def one(name: str) -> list[Driven]:
        with side_by_side([name], runs, LIMIT_S, BARE) as (process,):
            return process.driven()

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return list(pool.map(one, processors))


def _compared(native: Sequence[Driven], driven: Sequence[Driven]) -> dict[str, Any]:
    pairs = list(zip(native, driven, strict=True))
    return {
        "runs": len(pairs),
        "equal": sum(here == there for here, there in pairs),
        "equal_times": sum(_times(here) == _times(there) for here, there in pairs),
        "differ": [here.name for here, there in pairs if here != there],
    }


def _times(driven: Driven) -> list[list[int]]:
    return [one.lap_ms for one in driven.cars]


def _share(figures: Sequence[dict[str, Any]]) -> float:
    """Of the steps that float64 had to decide."""
    ways = [sum(column) for column in zip(*(one["ways"] for one in figures), strict=True)]
    return round((ways[EXACT] + ways[EXCEEDED]) / sum(ways), 5)


def _ratio(figures: Sequence[dict[str, Any]], *besides: str) -> float:
    """How much longer it takes with answers as they race, and all that is the same beside them."""
    same = sum(one[name] for one in figures for name in besides)
    judged, plain = (sum(one[name] for one in figures) for name in ("judged_s", "plain_s"))
    return round((same + judged) / (same + plain), 4)


def misses(figures: dict[str, Any]) -> list[str]:
    """What is promised and not kept."""
    found = []
    if figures["equal"] < figures["runs"]:
        differ = "; ".join(
            f"{name}: {', '.join(one['differ'])}" for name, one in figures["by_processor"].items() if one["differ"]
        )
        found.append(f"{figures['equal']} of {figures['runs']} runs are equal ({differ})")
    for car, most in MOST_COST.items():
        if figures["cost"].get(car, 0.0) > most:
            found.append(f"{car}'s run takes {figures['cost'][car]:.3f} times as long; {most:.2f} is promised")
    for car, used in figures["bound_used"].items():
        if used > MOST_BOUND_USED:
            found.append(f"{car}'s errors are {used:.2f} times its bound")
    return found


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine, race = figures["machine"], figures["race"]
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} to {machine['load_after']}; "
        f"{machine['engine']}; {race['laps']} laps of {', '.join(race['tracks'])}",
        "",
        f"{figures['equal']} of {figures['runs']} equal: trace to the bit, here and as",
    ]
    lines += [
        f"  {name:16}{one['equal']:>4} of {one['runs']}, lap times {one['equal_times']:>4} of {one['runs']}"
        for name, one in figures["by_processor"].items()
    ]
    lines += ["", f"{'':10}{'steps':>8}{'in float64':>12}{'bound used':>12}{'network':>10}{'run':>8}   times as long"]
    lines += [
        f"{car:10}{figures['steps'][car]:>8}{figures['slow_steps'][car]:>12.2%}{figures['bound_used'][car]:>12.0%}"
        f"{figures['network_cost'][car]:>10.3f}{figures['cost'][car]:>8.3f}"
        for car in figures["steps"]
    ]
    missed = misses(figures)
    return "\n".join([*lines, "", *(f"Missed: {line}" for line in missed)] if missed else lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 1 when a promise is not kept, 2 where nothing can be measured."""
    parser = command("processors", __doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one lap of the oval, as the first and last processor")
    parser.add_argument("--tracks", nargs="+", metavar="SLUG|FILE", help="instead of the six")
    parser.add_argument("--laps", type=int)
    parser.add_argument("--processors", nargs="+", metavar="NAME", help="as qemu-x86_64 -cpu help names them")
    options = parser.parse_args(arguments)
    if emulator() is None:
        print("qemu-x86_64 is not installed (Debian: qemu-user)", file=sys.stderr)
        return 2
    try:
        figures = run(
            names=options.tracks or (["oval"] if options.quick else tracks()),
            laps=options.laps or (1 if options.quick else LAPS),
            processors=options.processors or (PROCESSORS[::3] if options.quick else PROCESSORS),
        )
    except ProcessorFailed as error:
        print(error, file=sys.stderr)
        return 2
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
