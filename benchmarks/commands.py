"""``python -m benchmarks.commands [--json] [--beside CHECKOUT]``: the processor time of commands.

The time of ``evaluate`` is that to the first control step: twice a run of 10 simulated seconds, the shortest that the
rules allow, less one of 20. ``perf stat`` counts the time of all processes, also of the sandboxed ones, whose time no
parent gets. Python keeps compiled modules, as where Paddock is installed. ``--beside`` measures another checkout in
turns, because a busy machine makes only ratios comparable.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .machine import measured_on
from .models import CHECKOUT, CONSOLE_CAR, HOUSE_CARS
from .report import command, report

TRACK = "kuei-raceway"
DRIVEN_S = 10


def commands(driven_s: int = DRIVEN_S) -> dict[str, list[str]]:
    """The arguments of Python by the command's name; a run is ``driven_s`` simulated seconds long."""
    found = {
        "manage.py version": ["manage.py", "version"],
        "manage.py check": ["manage.py", "check"],
        "manage.py migrate --check": ["manage.py", "migrate", "--check"],
        "paddock --help": ["-m", "paddock.cli", "--help"],
    }
    cars = {"a house car": [str(HOUSE_CARS / "brisk.onnx"), str(HOUSE_CARS / "brisk.json")]}
    if CONSOLE_CAR.is_file():
        cars["the console's car"] = [str(CONSOLE_CAR)]
    rules = ["--rule", "laps=3", "--rule", f"max_simulated_ms={driven_s * 1000}"]
    for name, files in cars.items():
        found[f"manage.py evaluate, {name}"] = [
            *("manage.py", "evaluate", *files),
            *("--track", TRACK, "--laps", "3", "--time-limit", str(driven_s)),
        ]
        found[f"paddock evaluate, {name}"] = ["-m", "paddock.cli", "evaluate", *files, "--track", TRACK, *rules]
    return found


def processor_ms(checkout: Path, arguments: list[str], data: str) -> float:
    """Milliseconds of all processes of one command. Raises CalledProcessError, FileNotFoundError without ``perf``."""
    ours = {"PADDOCK_DATA": data, "PYTHONPATH": str(checkout), "PYTHONDONTWRITEBYTECODE": "", "OMP_NUM_THREADS": "1"}
    with tempfile.NamedTemporaryFile("r") as counted:
        subprocess.run(
            ["perf", "stat", "-x", ",", "-e", "task-clock", "-o", counted.name, "--", sys.executable, *arguments],
            cwd=checkout,
            env={**os.environ, **ours},
            capture_output=True,
            check=True,
        )
        line = next(line for line in counted if "task-clock" in line)
    return float(line.split(",")[0])


def first_step_ms(checkout: Path, name: str, data: str) -> float:
    """Milliseconds of the command ``name``, of a run those to its first control step."""
    whole = processor_ms(checkout, commands()[name], data)
    return 2 * whole - processor_ms(checkout, commands(2 * DRIVEN_S)[name], data) if "evaluate" in name else whole


def measure(checkouts: list[Path], runs: int, names: list[str]) -> dict[str, Any]:
    """The median of ``runs`` of each command in each checkout, which take turns; one more before them fills caches."""
    load = os.getloadavg()[0]
    found = {}
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as data:
        chosen = [name for name in commands() if any(part in name for part in names)]
        if "manage.py migrate --check" in chosen:  # else there is something to do
            processor_ms(checkouts[0], ["manage.py", "migrate", "--verbosity", "0"], data)
        for name in chosen:
            turns = [[first_step_ms(checkout, name, data) for checkout in checkouts] for _ in range(runs + 1)][1:]
            found[name] = [statistics.median(column) for column in zip(*turns, strict=True)]
    return {"machine": measured_on(load), "processor_ms": found}


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} to {machine['load_after']}"]
    for name, (own, *beside) in figures["processor_ms"].items():
        other = "".join(f"{ms:8.0f} ms beside, {own / ms:.0%} of it" for ms in beside)
        lines.append(f"{name:40}{own:8.0f} ms{other}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    parser = command("commands", "Processor time of commands.")
    parser.add_argument("--runs", type=int, default=7, help="of each command (default 7)")
    parser.add_argument("--beside", type=Path, metavar="CHECKOUT", help="another checkout, measured in turns")
    parser.add_argument(
        "--commands", nargs="+", default=[""], metavar="PART", help="only those with this in their name"
    )
    options = parser.parse_args(arguments)
    checkouts = [CHECKOUT, *([options.beside.resolve()] if options.beside else [])]
    return report(measure(checkouts, options.runs, options.commands), as_json=options.json, table=table)


if __name__ == "__main__":
    sys.exit(main())
