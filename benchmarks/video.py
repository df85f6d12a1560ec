"""``python -m benchmarks.video``: what a second of a run costs as a video, drawn and encoded by one process.

A car, or with ``--cars`` several, on the centre line of the oval at 2.5 m/s. Seconds are those of the processor.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import django

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")  # the imports below mark texts for translation

from tests.videos.drawing.runs import car, driven, lap, scene
from videos.drawing import MAX_SECONDS, write_video

from .machine import measured_on
from .report import command, report

MEMORY_MB = 400
SHELLS = (("paddock", "#ff5d3b"), ("formula", "#2dd4bf"), ("van", "#a855f7"), ("kart", "#f8fafc"))


def measure(seconds: float, cars: int) -> dict[str, Any]:
    """The figures of the video of a run of so many seconds."""
    load = os.getloadavg()[0]
    laps = [lap(1, 0, int(1000 * seconds))]
    drivers = [
        car(driven(seconds, 2.5 - 0.1 * number), number, shell=shell, colour=colour, laps=laps)
        for number, (shell, colour) in enumerate(SHELLS[:cars])
    ]
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        facts = write_video(scene(*drivers), Path(folder) / "run.mp4")
        spent = time.process_time() - began
    return {
        "cars": cars,
        "frames": facts.frames,
        "frames_a_second": round(facts.frames / spent, 1),
        "times_real_time": round(facts.duration_ms / 1000.0 / spent, 2),
        "drawing": round(facts.drawing_s / spent, 3),
        "encoding": round(facts.encoding_s / spent, 3),
        "mbit_a_second": round(facts.size * 8 / 1000.0 / facts.duration_ms, 2),
        "peak_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0),
        "machine": measured_on(load),
    }


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    return (
        f"{figures['frames']} frames, {figures['cars']} car(s): {figures['frames_a_second']:.0f} a second of the "
        f"processor, {figures['times_real_time']:.1f} times real time; {figures['drawing']:.0%} drawing, "
        f"{figures['encoding']:.0%} encoding; {figures['mbit_a_second']:.2f} Mbit/s, {figures['peak_mb']} MB"
    )


def main(arguments: list[str] | None = None) -> int:
    """Measure, print; 1 when it took more memory than is promised."""
    parser = command("video", "What a video costs.")
    parser.add_argument("--seconds", type=float, default=30.0, help="of the run, 1 to 600; default: %(default)s")
    parser.add_argument("--cars", type=int, choices=range(1, len(SHELLS) + 1), default=1)
    options = parser.parse_args(arguments)
    if not 1.0 <= options.seconds <= MAX_SECONDS:
        parser.error(f"argument --seconds: {options.seconds} is not from 1 to {MAX_SECONDS}")
    django.setup()
    figures = measure(options.seconds, options.cars)
    missed = [f"it took {figures['peak_mb']} MB"] if figures["peak_mb"] > MEMORY_MB else []
    return report(figures, as_json=options.json, table=table, missed=missed)


if __name__ == "__main__":
    sys.exit(main())
