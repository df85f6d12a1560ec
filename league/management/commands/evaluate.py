"""``manage.py evaluate``: time a model from the command line, through the same wall and simulator as the site's."""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from evaluation.packages.admit import AdmittedPackage, admit
from evaluation.packages.read import UploadPart
from evaluation.pipeline import EvaluationOutcome, RaceJob, evaluate
from evaluation.simulator.rules import DIRECTIONS, RaceRules
from faults import PaddockError, UserFault
from league.templatetags.paddock import lap_time
from tracks.catalogue import CATALOGUE
from tracks.geometry import TrackGeometry
from tracks.npy import MAX_BYTES, read_npy

REFUSED, OUR_FAULT = 2, 3


class Command(BaseCommand):
    """Needs neither database nor broker."""

    help = (
        "Time a model on a track without the site: the same reading, wall and simulator. "
        f"Exit status {REFUSED}: the model or the track is refused; {OUR_FAULT}: Paddock itself failed."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        rules = RaceRules()
        parser.add_argument("package", type=Path, help="a car's archive (.tar.gz, .zip) or an .onnx file")
        parser.add_argument("metadata", type=Path, nargs="?", help="model_metadata.json, beside an .onnx file")
        parser.add_argument("--track", required=True, help="a track of the catalogue by its address, or an .npy file")
        parser.add_argument("--direction", choices=DIRECTIONS, default=rules.direction, help="default: %(default)s")
        parser.add_argument("--laps", type=int, default=rules.laps, help="default: %(default)s")
        parser.add_argument("--seed", type=int, default=rules.seed, help="default: %(default)s")
        parser.add_argument(
            "--off-track-penalty",
            type=float,
            default=rules.off_track_penalty_ms / 1000,
            metavar="SECONDS",
            help="default: %(default)s",
        )
        parser.add_argument(
            "--collision-penalty",
            type=float,
            default=rules.collision_penalty_ms / 1000,
            metavar="SECONDS",
            help="default: %(default)s",
        )
        parser.add_argument(
            "--max-resets",
            type=int,
            default=rules.max_resets,
            help="0: the first fault ends the run; default: %(default)s",
        )
        parser.add_argument(
            "--time-limit",
            type=float,
            default=rules.max_simulated_ms / 1000,
            metavar="SECONDS",
            help="of simulated time; default: %(default)s",
        )
        parser.add_argument("--trace", type=Path, metavar="FILE", help="write the run's sim-trace (CSV) there")
        parser.add_argument("--json", action="store_true", help="print the field's metrics JSON and what we measured")

    def handle(self, *, package: Path, metadata: Path | None, track: str, **options: Any) -> None:
        as_json = options["json"]
        try:
            rules = _rules(options)
            geometry = find_track(track).in_direction(rules.direction)
            started = time.monotonic()
            admitted = _admit([package] if metadata is None else [package, metadata])
            admission_s = time.monotonic() - started
            job = RaceJob(geometry, rules, admitted.onnx, admitted.metadata.to_dict())
            outcome = evaluate(job, wall_limit_s=settings.EVALUATION_WALL_SECONDS)
        except PaddockError as fault:
            if as_json:
                self.stdout.write(json.dumps({"error": {**fault.to_dict(), "message": str(fault)}}, indent=2))
            for note in getattr(fault, "__notes__", ()):
                self.stderr.write(note)
            self.stderr.write(f"{fault.code}: {fault}")
            sys.exit(REFUSED if isinstance(fault, UserFault) else OUR_FAULT)
        except KeyboardInterrupt:
            sys.exit(130)
        if options["trace"] is not None:
            _write(options["trace"], outcome.trace_csv)
        if as_json:
            self.stdout.write(json.dumps(report(outcome, admitted, admission_s), indent=2))
        else:
            self._table(outcome, geometry, admission_s)

    def _table(self, outcome: EvaluationOutcome, geometry: TrackGeometry, admission_s: float) -> None:
        figures = report_times(outcome)
        self.stdout.write(f"{geometry.name}, {geometry.length:.2f} m, {geometry.direction}\n\n")
        self.stdout.write("lap       time  off track  resets  status")
        for lap in outcome.laps:
            row = f"{lap['number']:>3} {lap_time(lap['time_ms']):>10} {lap['off_tracks']:>10} {lap['resets']:>7}"
            self.stdout.write(f"{row}  {lap['status']}")
        self.stdout.write("")
        for name in ("average", "best", "total"):
            self.stdout.write(f"{name:<8}{lap_time(figures[f'{name}_lap_ms' if name != 'total' else 'total_ms']):>11}")
        simulated_s = outcome.simulated_ms / 1000
        self.stdout.write(
            f"\nended: {outcome.end_reason}; {simulated_s:.1f} s simulated in {outcome.wall_s:.1f} s "
            f"({simulated_s / outcome.wall_s:.0f} times real time), admitted in {admission_s:.1f} s"
        )
        self.stdout.write(f"engine {outcome.engine}, trace {outcome.trace_sha256}")


def report_times(outcome: EvaluationOutcome) -> dict[str, int | None]:
    """Average and best over the complete laps (None without one, the average rounded down) and the time of all laps."""
    complete = [lap["time_ms"] for lap in outcome.laps if lap["complete"]]
    return {
        "average_lap_ms": sum(complete) // len(complete) if complete else None,
        "best_lap_ms": min(complete, default=None),
        "total_ms": sum(lap["time_ms"] for lap in outcome.laps),
    }


def report(outcome: EvaluationOutcome, admitted: AdmittedPackage, admission_s: float) -> dict[str, Any]:
    """The field's metrics JSON with our figures beside it.

    ``wall_seconds``: of the whole evaluation, its processes' start included; reading and checking the model before it
    took ``admission_seconds``.
    """
    return {
        **outcome.metrics,
        **report_times(outcome),
        "complete_laps": sum(lap["complete"] for lap in outcome.laps),
        "end_reason": outcome.end_reason,
        "trace_sha256": outcome.trace_sha256,
        "engine": outcome.engine,
        "versions": outcome.versions,
        "cpu_model": outcome.cpu_model,
        "simulated_seconds": outcome.simulated_ms / 1000,
        "wall_seconds": round(outcome.wall_s, 3),
        "admission_seconds": round(admission_s, 3),
        "shares": {name: round(seconds, 4) for name, seconds in outcome.shares.items()},
        "peak_mb": round(outcome.peak_mb, 1),
        "steps": outcome.steps,
        "model_sha256": admitted.sha256,
    }


def find_track(name: str) -> TrackGeometry:
    """A catalogue track by its slug, or the track in an ``.npy`` file. Raises UserFault for a bad file."""
    for track in CATALOGUE:
        if track.slug == name:
            return track.geometry()
    path = Path(name)
    if path.suffix != ".npy":
        known = ", ".join(track.slug for track in CATALOGUE)
        raise CommandError(f"There is no track {name!r}. Name an .npy file or one of: {known}.")
    try:
        with path.open("rb") as file:
            return read_npy(file.read(MAX_BYTES + 1), path.stem)
    except OSError as error:
        raise CommandError(f"{path} cannot be read: {error.strerror}.") from error


def _admit(paths: list[Path]) -> AdmittedPackage:
    with ExitStack() as stack:
        try:
            parts = [UploadPart(path.name, stack.enter_context(path.open("rb"))) for path in paths]
        except OSError as error:
            raise CommandError(f"{error.filename} cannot be read: {error.strerror}.") from error
        return admit(parts)


def _rules(options: dict[str, Any]) -> RaceRules:
    try:
        return RaceRules(
            laps=options["laps"],
            seed=options["seed"],
            direction=options["direction"],
            max_resets=options["max_resets"],
            off_track_penalty_ms=round(options["off_track_penalty"] * 1000),
            collision_penalty_ms=round(options["collision_penalty"] * 1000),
            max_simulated_ms=round(options["time_limit"] * 1000),
        )
    except (ValueError, OverflowError) as error:
        raise CommandError(f"These rules make no sense: {error}.") from error


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}.") from error
