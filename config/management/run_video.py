"""The video of a run that a command drove."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from django.core.management.base import CommandError

from config.management import Refusal
from evaluation.looks import VehicleLook, told_apart
from evaluation.pipeline import CompetitorOutcome, EvaluationOutcome
from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from videos.drawing import VideoCar, VideoScene, write_video

_ENDINGS = (".tar.gz", ".tgz", ".zip", ".onnx")


def save_video(path: Path, track: TrackGeometry, outcome: EvaluationOutcome, files: Sequence[str]) -> None:
    """Draw the run, all of its cars, and write an MP4 over whatever is at ``path``; ``files`` name the cars.

    Raises Refusal for a run that no video can show, CommandError where the file cannot be written. Then, and when
    interrupted (exit status 130), the path is as it was.
    """
    looks = told_apart([VehicleLook()] * len(files))
    results: list[EvaluationOutcome | CompetitorOutcome] = [outcome, *outcome.rivals]
    cars = [
        VideoCar(number, name_of(file), look.shell, look.colour, result.trace_csv, result.laps)
        for number, (file, look, result) in enumerate(zip(files, looks, results, strict=True))
    ]
    way = "start to end" if track.is_open else "counter-clockwise" if track.direction == "ccw" else "clockwise"
    words = f"{track.length:.1f} m, {way}"
    try:
        write_video(VideoScene(track, track.name, words, cars, layout=outcome.layout, order=outcome.order), path)
    except UserFault as fault:
        raise Refusal(fault) from fault
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}.") from error
    except KeyboardInterrupt:
        sys.exit(130)


def name_of(file: str) -> str:
    """A car's name from that of its file, or of the first of its files."""
    name = Path(file.split(",", 1)[0]).name
    return next((name[: -len(ending)] for ending in _ENDINGS if name.endswith(ending)), name) or name
