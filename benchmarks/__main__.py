"""``python -m benchmarks``: all benchmarks one after the other, as one JSON object keyed by part.

Each part is a program of its own, and can be run as one with more options; here they take half an hour together on two
idle cores, and with ``--quick`` a few minutes. A part that cannot be measured here says why (``error``), and the others
are measured all the same. What a part promises and does not keep stands in ``missed``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

from . import load

# Part: module, and options for a full and for a quick measurement.
PARTS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "evaluation": ("evaluation", (), ("--runs", "1", "--laps", "1", "--no-site")),
    "commands": ("commands", (), ("--runs", "3", "--commands", "version", "help")),
    "car_report": ("car_report", (), ("--models", "flyer")),
    "board": ("board", ("--runs", "9"), ("--sizes", "1000,10000", "--runs", "3", "--closed", "2000", "--load", "0")),
    "board_postgres": (
        "board",
        ("--postgres", "--runs", "9", "--load", "0"),
        ("--postgres", "--sizes", "1000,10000", "--runs", "3", "--closed", "2000", "--load", "0"),
    ),
    "queue": ("queue", (), ("--runs", "9")),
    "queue_postgres": ("queue", ("--postgres",), ("--postgres", "--runs", "9")),
    "deadline": ("deadline", ("--students", "100"), ("--students", "20")),
    "deadline_postgres": ("deadline", ("--postgres",), ("--postgres", "--students", "20")),
    "season": ("season", (), ("--results", "1000,3000")),
    "season_postgres": ("season", ("--postgres",), ("--postgres", "--results", "1000,3000")),
    "training": (
        "training",
        ("--seeds", "1", "--parts", "laps", "--compared-steps", "0"),
        ("--seeds", "1", "--parts", "laps", "--compared-steps", "0", "--tracks", "oval"),
    ),
    "generalist": ("generalist", (), ("--minutes", "0.5", "--unseen", "oval-track")),
    "deepracer": ("deepracer", (), ("--steps", "300")),
    "house_start": ("house_start", (), ("--tracks", "oval")),
    "video": ("video", (), ("--seconds", "5")),
    "reads": ("reads", (), ("--runs", "1")),
    "pages": ("pages", (), ("--runs", "3")),
    "pages_postgres": ("pages", ("--postgres",), ("--postgres", "--runs", "3")),
    "pages_big": ("pages", ("--big",), ("--big", "--runs", "3", "--pages", "home", "race")),
    "comparing": ("comparing", (), ("--people", "10", "--pause", "3", "--turns", "1")),
    "slow": ("slow", (), ("--connections", "200", "--seconds", "2")),
    "spectators": ("spectators", (), ("--seconds", "2", "--rate", "100")),
    "streams": ("streams", (), ("--streams", "50", "--seconds", "20")),
    "live": ("live", (), ("--quick",)),
    "panels": ("panels", (), ("--panels", "20", "--seconds", "6")),
    "rest": ("rest", (), ("--starts", "1", "--rest", "20")),
    "processors": ("processors", (), ("--quick",)),
}
LIMIT_S = 3600


def run(part: str, *, quick: bool) -> dict[str, Any]:
    """The figures of a part, with ``seconds`` that it took and what was ``missed``; or an ``error``."""
    module, full, short = PARTS[part]
    options = [*(short if quick else full)]
    if module == "board" and "--load" not in options and not load.is_there():
        options += ["--load", "0"]
    command = [sys.executable, "-m", f"benchmarks.{module}", "--json", *options]
    began = time.monotonic()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, env=os.environ)
        figures = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        return {"error": f"not done after {LIMIT_S} s"}
    except ValueError:  # no JSON: it could not measure
        return {"error": done.stderr.strip()[-2000:] or f"ended with {done.returncode} and without figures"}
    missed = [line.removeprefix("missed: ") for line in done.stderr.splitlines() if line.startswith("missed: ")]
    return {"seconds": round(time.monotonic() - began, 1), "missed": missed, "figures": figures}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 1 when a part could not be measured. Promises that are missed are told, not judged."""
    parser = argparse.ArgumentParser("python -m benchmarks", description="All benchmarks, as one JSON object.")
    parser.add_argument("--quick", action="store_true", help="less of everything: minutes")
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    options = parser.parse_args(arguments)
    found = {}
    for part in options.parts:
        print(f"{part} …", file=sys.stderr, flush=True)
        found[part] = run(part, quick=options.quick)
    print(json.dumps(found, indent=2))
    return 1 if any("error" in figures for figures in found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
