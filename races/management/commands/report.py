"""``manage.py report``: a car's report from the command line, with the site's sandbox, simulator and grade."""

import json
from argparse import ArgumentParser
from dataclasses import asdict
from pathlib import Path
from typing import Any

from django.conf import settings

from core.management.base import OUR_FAULT, REFUSED, JsonCommand
from core.templatetags.formats import lap_time
from evaluation.garage.admission import AdmittedPackage
from evaluation.reports import MOST_IN_CHUNK
from evaluation.reports.grading import DrivenLap, KindSummary, digest_of, robustness_of
from evaluation.reports.planning import LEAGUE
from evaluation.running.drives import DriveJob, DriveOutcome, LapDrive, drive_all
from evaluation.running.race_setup import Venue
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.catalogue.names import direction_in
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import DIRECTIONS
from paddock.rules.report import MOST_SEED
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.randomisation import check_placed, variations
from races.management.commands.evaluate import admit_files
from tracks.management.track_lookup import TRACK_HELP, find_track

SETS = {"league": LEAGUE, "catalogue": tuple(track.slug for track in CATALOGUE), "none": ()}


class Command(JsonCommand):
    """Needs no broker, and a database only for a track that is in it alone."""

    help = (
        "Drive a model on many tracks and under a hundred variations of a lap, and say how robust it is. "
        f"Exit status {REFUSED}: the model or a track is refused; {OUR_FAULT}: Paddock itself failed."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument(
            "package", type=Path, help="a model's archive or a training's folder (.tar.gz, .zip), or an .onnx file"
        )
        parser.add_argument("metadata", type=Path, nargs="?", help="model_metadata.json, beside an .onnx file")
        parser.add_argument(
            "--tracks",
            default="league",
            metavar="SET",
            help=f"{', '.join(SETS)}, or tracks with commas between (each {TRACK_HELP}); both directions of each; "
            "default: league",
        )
        parser.add_argument(
            "--variations-on", default="oval", metavar="TRACK", help=f"{TRACK_HELP}; none for none; default: oval"
        )
        parser.add_argument("--direction", choices=DIRECTIONS, help="of the varied laps; default: the file's own")
        parser.add_argument("--seed", type=int, default=0, help=f"of the variations, 0 to {MOST_SEED}")
        parser.add_argument("--json", action="store_true", help="print everything as JSON")

    def handle(self, *, package: Path, metadata: Path | None, seed: int, tracks: str, **options: Any) -> None:
        with self.exit_on_fault(as_json=options["json"], verbosity=options["verbosity"]):
            drives, own = _drives(seed, tracks, options["variations_on"], options["direction"])
            car = admit_files([path for path in (package, metadata) if path is not None])
            outcomes, engine = self._driven(car, drives)
        laps = [_lap(drive, outcome, own[drive.number]) for drive, outcome in zip(drives, outcomes, strict=True)]
        digest = digest_of(network=car.sha256, seed=seed, engine=engine, laps=laps)
        robustness = robustness_of(laps)
        if options["json"]:
            document = {
                "laps": [
                    asdict(lap) | {"track": own[drive.number].name, "status": outcome.status}
                    for lap, drive, outcome in zip(laps, drives, outcomes, strict=True)
                ],
                "robustness": None if robustness is None else asdict(robustness),
                "engine": engine,
                "model_sha256": car.sha256,
                "runs_sha256": digest,
            }
            self.stdout.write(json.dumps(document, indent=2))
            return
        for lap, outcome in zip(laps, outcomes, strict=True):
            if lap.variation is None:
                figure = lap_time(lap.time_ms) if lap.complete else f"{int(lap.percent)} %"
                self.stdout.write(f"{own[lap.number].name:<32}{lap.direction:<5}{figure:>10}  {outcome.status}")
        if robustness is not None:
            self.stdout.write("\nkind      completed  every one up to  median lap  spread")
            for summary in (*robustness.kinds, robustness.overall):
                self.stdout.write(_row(summary))
            self.stdout.write(f"grade {robustness.grade}")
        self.stdout.write(f"engine {engine}, runs {digest}")

    def _driven(self, car: AdmittedPackage, drives: list[LapDrive]) -> tuple[list[DriveOutcome], str]:
        outcomes: list[DriveOutcome] = []
        engine = ""
        for at in range(0, len(drives), MOST_IN_CHUNK):
            job = DriveJob(
                car.onnx, car.metadata.to_dict(), car.facts.to_dict(), tuple(drives[at : at + MOST_IN_CHUNK])
            )
            outcome = drive_all(job, wall_limit_s=settings.EVALUATION_WALL_SECONDS)
            outcomes += outcome.drives
            engine = outcome.engine
        return outcomes, engine


def _drives(
    seed: int, tracks: str, variations_on: str, direction: str | None
) -> tuple[list[LapDrive], dict[int, TrackGeometry]]:
    """The laps in the order of a report on the site, and their tracks by number. Raises UserFault, Refusal."""
    if not 0 <= seed <= MOST_SEED:
        raise UserFault("report_seed", most=MOST_SEED)
    named = SETS.get(tracks)
    names = tracks.split(",") if named is None else named
    drives: list[LapDrive] = []
    own: dict[int, TrackGeometry] = {}
    for name in names:
        found = find_track(name)
        for way in sorted(DIRECTIONS, key=lambda way: way != found.geometry.direction):
            own[len(drives)] = found.geometry
            drives.append(LapDrive(len(drives), Venue(found.geometry.in_direction(way), way, found.look)))
    if variations_on != "none":
        found = find_track(variations_on)
        if found.geometry.is_open:
            raise UserFault("report_no_way_round", track=found.geometry.name)
        way = direction or direction_in(variations_on) or found.geometry.direction
        venue = Venue(found.geometry.in_direction(way), way, found.look)
        for one in variations(seed, venue.track.length):
            check_placed(venue.track, one, THEMES[venue.look])
            own[len(drives)] = found.geometry
            drives.append(LapDrive(len(drives), venue, one))
    if not drives:
        raise UserFault("report_empty")
    return drives, own


def _lap(drive: LapDrive, outcome: DriveOutcome, track: TrackGeometry) -> DrivenLap:
    """``track``: as its file has it, whichever way it was driven."""
    return DrivenLap(
        number=drive.number,
        track=track.fingerprint,
        direction=drive.venue.direction,
        variation=None if drive.variation is None else drive.variation.number,
        complete=outcome.complete,
        time_ms=outcome.time_ms,
        percent=outcome.percent,
        trace_sha256=outcome.trace_sha256,
    )


def _row(summary: KindSummary) -> str:
    median = "–" if summary.median_ms is None else lap_time(summary.median_ms)
    spread = "–" if summary.spread_permille is None else f"{summary.spread_permille / 10:.1f} %"
    copes = f"{summary.copes_percent} %" if summary.kind else ""
    name = summary.kind or "in all"
    return f"{name:<10}{summary.completed:>4} / {summary.driven:<4}{copes:>14}{median:>12}{spread:>9}"
