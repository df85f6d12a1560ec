"""``python -m benchmarks.house_start [--json]``: three clean laps on every track, from a house car and from nothing.

The training is the one that the wizard makes (``benchmarks/training.py``), with one seed. It ends with three clean laps
in a row from the finish line. Seconds of processor time, the start of the process and every evaluation included.
"""

from __future__ import annotations

import os
import statistics
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from paddock.geometry.catalogue import CATALOGUE

from .machine import measured_on
from .report import command, report
from .training import first_laps, wizard_spec

HOUSE_CAR = Path(__file__).parent.parent / "training" / "house_cars" / "admitted" / "steady.onnx"
STARTS = ("house car", "nothing")


def run(tracks: list[str], starts: list[str], seed: int) -> dict[str, Any]:
    """All figures as JSON values: for each track and start ``cpu_s``, ``iterations``, ``steps`` and ``lapped``."""
    load = os.getloadavg()[0]
    weights = {"house car": HOUSE_CAR.read_bytes(), "nothing": b""}
    rows = {
        slug: {start: first_laps(slug, wizard_spec(slug, seed), weights[start]) for start in starts} for slug in tracks
    }
    return {"machine": measured_on(load), "seed": seed, "starts": starts, "tracks": rows}


def misses(figures: dict[str, Any]) -> list[str]:
    """The tracks where a training from the house car does not lap."""
    rows = figures["tracks"].items()
    return [
        f"{slug}: no three clean laps" for slug, row in rows if not row.get("house car", {"lapped": True})["lapped"]
    ]


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    starts, rows = figures["starts"], figures["tracks"]
    lines = ["| track | " + " | ".join(f"from {start}" for start in starts) + " |", "|---|" + "---:|" * len(starts)]
    for slug, row in rows.items():
        cells = [f"{row[start]['cpu_s']:.1f} s" if row[start]["lapped"] else "no" for start in starts]
        lines.append(f"| {slug} | {' | '.join(cells)} |")
    for start in starts:
        seconds = [row[start]["cpu_s"] for row in rows.values() if row[start]["lapped"]]
        if seconds:
            at_once = sum(row[start]["iterations"] == 1 for row in rows.values())
            lines.append(
                f"From {start}: {len(seconds)} of {len(rows)} tracks, median {statistics.median(seconds):.1f} s, "
                f"slowest {max(seconds):.1f} s; {at_once} in the first evaluation."
            )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    slugs = [track.slug for track in CATALOGUE]
    parser = command("house_start", "Time to three clean laps, from a house car and from nothing.")
    parser.add_argument("--tracks", nargs="+", default=slugs, choices=slugs, metavar="TRACK")
    parser.add_argument("--starts", nargs="+", default=list(STARTS), choices=STARTS)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    figures = run(options.tracks, options.starts, options.seed)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
