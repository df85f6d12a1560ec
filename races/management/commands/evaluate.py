"""``manage.py evaluate``: time a model from the command line, through the same sandbox and simulator as the site's."""

import hashlib
import json
import sys
import time
from argparse import ArgumentParser
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from django.apps import apps
from django.conf import settings
from django.core.management.base import CommandError

from core.management.base import OUR_FAULT, REFUSED, JsonCommand, Refusal
from core.management.light import load_apps
from core.times import clock
from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.garage.uploads import package_limits, upload_summary
from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome, RaceJob, RivalModel, evaluate
from evaluation.running.race_setup import check_rivals
from paddock.errors import PlatformFault, UserFault, fault_from_dict
from paddock.geometry.catalogue.names import direction_in
from paddock.geometry.track import TrackGeometry
from paddock.packages.kinds import FORMATS
from paddock.packages.read import UploadPart
from paddock.rules.race import MAX_CARS
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.layout import lay_out
from paddock.simulator.results import Fault
from races.boards.ranking import RULES as RANKING
from races.management import race_options
from tracks.management.track_lookup import TRACK_HELP, find_track

_ENDINGS = (".tar.gz", ".tgz", ".zip", ".onnx")


class Command(JsonCommand):
    """Needs no broker, and a database only for a track that is in it alone."""

    help = (
        "Time a model on a track without the site: the same reading, sandbox and simulator. "
        f"Exit status {REFUSED}: the model, the track or the race is refused; {OUR_FAULT}: Paddock itself failed."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument(
            "package", type=Path, help="a model's archive or a training's folder (.tar.gz, .zip), or an .onnx file"
        )
        parser.add_argument("metadata", type=Path, nargs="?", help="model_metadata.json, beside an .onnx file")
        where = parser.add_mutually_exclusive_group(required=True)
        where.add_argument("--track", help=TRACK_HELP)
        where.add_argument(
            "--race",
            metavar="RACE",
            help="by the rules of a race of this site, on its track: the address of its page, or the last part of that",
        )
        parser.add_argument(
            "--look", choices=sorted(THEMES), help="what cameras see of it; default: the track's own, as on the site"
        )
        parser.add_argument(
            "--checkpoint",
            default="",
            metavar="WHICH",
            help="of a training's folder: best, last, or the number in model_<number>.pb; default: the best by "
            "deepracer_checkpoints.json, else the last",
        )
        parser.add_argument(
            "--weights",
            type=Path,
            metavar="FILE",
            help="the .onnx.data file beside an .onnx file, if it has one",
        )
        race_options.add_race_options(parser)
        race_options.add_ranking_options(parser)
        parser.add_argument(
            "--rival",
            action="append",
            default=[],
            metavar="PACKAGE",
            help="another car in the same race: an archive, or ONNX,METADATA[,WEIGHTS]; repeat it, at most "
            f"{MAX_CARS - 1} times",
        )
        parser.add_argument(
            "--trace",
            type=Path,
            metavar="FILE",
            help="write the run's sim-trace (CSV) there, those of rivals beside it (FILE-car1 and so on)",
        )
        parser.add_argument(
            "--video", type=Path, metavar="FILE", help="write a video of the run there (MP4), with all of its cars"
        )
        parser.add_argument("--json", action="store_true", help="print the field's metrics JSON and what we measured")

    def handle(self, *, package: Path, metadata: Path | None, **options: Any) -> None:
        as_json = options["json"]
        with self.exit_on_fault(as_json=as_json, verbosity=options["verbosity"]):
            found, rules, method, needed = _asked(options)
            check_rivals(rules, len(options["rival"]))
            ranking = RANKING[method]
            geometry = found.geometry.in_direction(rules.direction)
            race_options.check_start(rules, geometry.length)
            lay_out(geometry, rules)  # before anything takes long
            started = time.monotonic()
            paths = [path for path in (package, metadata, options["weights"]) if path is not None]
            cars = [admit_files(paths, options["checkpoint"])]
            for sentence in upload_summary(cars[0]):
                self.stderr.write(sentence)
            cars += [admit_files(_files_of(rival)) for rival in options["rival"]]
            admission_s = time.monotonic() - started
            first, *rivals = [RivalModel(car.onnx, car.metadata.to_dict(), car.facts.to_dict()) for car in cars]
            look = options["look"] or found.look
            job = RaceJob(geometry, rules, first.onnx, first.metadata, tuple(rivals), look, first.facts)
            outcome = evaluate(job, wall_limit_s=settings.EVALUATION_WALL_SECONDS)
        worth = ranking.standing(outcome.laps, needed)
        if as_json:
            ranked = {"classified": worth.classified, "score_ms": worth.score_ms}
            self.stdout.write(json.dumps(report(outcome, cars, admission_s) | ranked, indent=2))
        else:
            self._table(outcome, geometry, admission_s)
            score = "not classified" if worth.score_ms is None else clock(worth.score_ms)
            self.stdout.write(f"by {ranking.code}, {needed} laps in a row: {score}")
        if options["trace"] is not None:  # last: the figures are printed even if it cannot be written
            _write_traces(options["trace"], outcome)
        if options["video"] is not None:
            save_video(options["video"], geometry, outcome, [str(package), *options["rival"]])

    def _table(self, outcome: EvaluationOutcome, geometry: TrackGeometry, admission_s: float) -> None:
        self.stdout.write(f"{geometry.name}, {geometry.length:.2f} m, {geometry.direction}\n")
        everyone: list[EvaluationOutcome | CompetitorOutcome] = [outcome, *outcome.rivals]
        for number, car in enumerate(everyone):
            if outcome.rivals:
                self.stdout.write(f"\ncar {number}, place {outcome.order.index(number) + 1}")
            self._laps(car)
        simulated_s = outcome.simulated_ms / 1000
        self.stdout.write(
            f"\nended: {outcome.end_reason}; {simulated_s:.1f} s simulated in {outcome.wall_s:.1f} s "
            f"({simulated_s / outcome.wall_s:.0f} times real time), admitted in {admission_s:.1f} s"
        )
        self.stdout.write(f"engine {outcome.engine}, trace {outcome.trace_sha256}")

    def _laps(self, car: EvaluationOutcome | CompetitorOutcome) -> None:
        self.stdout.write("\nlap       time  off track  crashes  resets  status")
        for lap in car.laps:
            faults = f"{lap['off_tracks']:>10} {lap['crashes']:>8} {lap['resets']:>7}"
            self.stdout.write(f"{lap['number']:>3} {clock(lap['time_ms']):>10} {faults}  {lap['status']}")
        self.stdout.write("")
        figures = car_times(car)
        for name in ("average", "best", "total"):
            self.stdout.write(f"{name:<8}{clock(figures[f'{name}_lap_ms' if name != 'total' else 'total_ms']):>11}")
        if car.retired:
            self.stdout.write(f"retired: {car.retired['code']}: {_with_message(car.retired)['message']}")


def _asked(options: dict[str, Any]) -> race_options.FoundRace:
    """The race to drive: one of this site, or a track with the rules of the options."""
    if options["race"] is not None:
        if given := [*race_options.options_given(options), *(["--look"] if options["look"] else [])]:
            problem = f"{', '.join(given)} belong to --track: a race has its own"
            raise Refusal(UserFault("command_line", problem=problem))
        return race_options.find_race(options["race"])
    if options["direction"] is None:
        options["direction"] = direction_in(options["track"])
    rules = race_options.rules_of(options)
    return race_options.FoundRace(find_track(options["track"]), rules, *race_options.ranking_of(options))


def car_times(car: EvaluationOutcome | CompetitorOutcome) -> dict[str, int | None]:
    """Average and best over the complete laps (None without one, the average rounded down) and the time of all laps."""
    complete = [lap["time_ms"] for lap in car.laps if lap["complete"]]
    return {
        "average_lap_ms": sum(complete) // len(complete) if complete else None,
        "best_lap_ms": min(complete, default=None),
        "total_ms": sum(lap["time_ms"] for lap in car.laps),
    }


def report(outcome: EvaluationOutcome, cars: list[AdmittedPackage], admission_s: float) -> dict[str, object]:
    """The field's metrics JSON with our figures beside it.

    ``wall_seconds``: of the evaluation with its processes; ``admission_seconds``: of reading and checking the models;
    ``layout_sha256``: of boxes and bots; ``order``: car numbers, winner first."""
    layout = json.dumps(outcome.layout, sort_keys=True, separators=(",", ":")).encode()
    return {
        **_car_report(outcome, cars[0]),
        "order": outcome.order,
        "rivals": [_car_report(car, package) for car, package in zip(outcome.rivals, cars[1:], strict=True)],
        "layout": {"boxes": outcome.layout.get("boxes", []), "bots": len(outcome.layout.get("bots", []))},
        "layout_sha256": hashlib.sha256(layout).hexdigest(),
        "engine": outcome.engine,
        "versions": outcome.versions,
        "cpu_model": outcome.cpu_model,
        "simulated_seconds": outcome.simulated_ms / 1000,
        "wall_seconds": round(outcome.wall_s, 3),
        "admission_seconds": round(admission_s, 3),
        "shares": {name: round(seconds, 4) for name, seconds in outcome.shares.items()},
        "peak_mb": round(outcome.peak_mb, 1),
        "steps": outcome.steps,
    }


def _car_report(car: EvaluationOutcome | CompetitorOutcome, package: AdmittedPackage) -> dict[str, object]:
    return {
        **car.metrics,
        **car_times(car),
        "complete_laps": sum(lap["complete"] for lap in car.laps),
        "off_tracks": sum(lap["off_tracks"] for lap in car.laps),
        "crashes": sum(lap["crashes"] for lap in car.laps),
        "resets": sum(lap["resets"] for lap in car.laps),
        "end_reason": car.end_reason,
        "retired": _with_message(car.retired) if car.retired else None,
        "trace_sha256": car.trace_sha256,
        "model_sha256": package.sha256,
    }


def _with_message(retired: Fault) -> dict[str, object]:
    return {**retired, "message": str(fault_from_dict(retired))}


def admit_files(paths: list[Path], checkpoint: str = "") -> AdmittedPackage:
    """Read and gate a model's files as an upload. Raises PaddockError, Refusal."""
    with ExitStack() as stack:
        try:
            parts = [UploadPart(path.name, stack.enter_context(path.open("rb"))) for path in paths]
        except OSError as error:
            raise Refusal.unreadable(error) from error
        checkpoint = checkpoint.strip().lower()
        try:
            return admit(parts, package_limits(), checkpoint=checkpoint)
        except PlatformFault as fault:
            if apps.ready or fault.code not in {one.no_process for one in FORMATS.values()}:
                raise
        load_apps()  # an app may register the process that reads this format
        for part in parts:
            part.stream.seek(0)
        return admit(parts, package_limits(), checkpoint=checkpoint)


def _files_of(rival: str) -> list[Path]:
    """The files that ``--rival`` names: one package, or an ONNX file and its metadata with a comma between."""
    whole = Path(rival)
    if whole.exists():
        return [whole]
    return [Path(part) for part in rival.split(",", 2)]


def _write_traces(path: Path, outcome: EvaluationOutcome) -> None:
    _write(path, outcome.trace_csv)
    for number, car in enumerate(outcome.rivals, 1):
        _write(path.with_name(f"{path.stem}-car{number}{path.suffix}"), car.trace_csv)


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}.") from error


def save_video(path: Path, track: TrackGeometry, outcome: EvaluationOutcome, files: Sequence[str]) -> None:
    """Write the run as an MP4 to ``path``; ``files`` name the cars. Raises Refusal for a run that no video can show,
    CommandError for an unwritable file; then the path is unchanged."""
    from evaluation.appearance.looks import VehicleLook, distinguish_looks
    from videos.drawing import VideoCar, VideoScene, write_video

    looks = distinguish_looks([VehicleLook()] * len(files))
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
