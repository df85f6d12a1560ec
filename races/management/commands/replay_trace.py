"""``manage.py replay_trace``: how near our car comes to a drive that the official simulator recorded."""

import json
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from core.management.base import OUR_FAULT, REFUSED, JsonCommand, Refusal
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.replay import MAX_BYTES, compare, read_drives, share_on_track
from tracks.management.track_lookup import TRACK_HELP, find_track

# Less of a recording than this on the named track, and it is another one's.
ANOTHER_TRACK = 0.5


class Command(JsonCommand):
    """Needs no broker, and a database only for a track that is in it alone."""

    help = (
        "Drive the actions of a recorded sim-trace again, from each of its states, and compare with the recorded poses "
        "after 0.33, 1 and 2 s, beside a kinematic bicycle. "
        f"Exit status {REFUSED}: the trace or the track is refused; {OUR_FAULT}: Paddock itself failed."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("trace", type=Path, help="a sim-trace (CSV) of the official simulator")
        parser.add_argument("--track", required=True, help=TRACK_HELP)
        parser.add_argument("--json", action="store_true", help="print the figures as JSON")

    def handle(self, *, trace: Path, track: str, **options: Any) -> None:
        as_json = options["json"]
        with self.exit_on_fault(as_json=as_json, verbosity=options["verbosity"]):
            geometry = find_track(track).geometry
            drives = read_drives(_read(trace))
            comparison = compare(drives)
        on_track = round(share_on_track(drives, geometry), 3)
        report = {
            "trace": trace.name,
            "track": geometry.name,
            "engine": ENGINE_ID,
            "physics": {"name": PADDOCK_CAR.name, "version": PADDOCK_CAR.version},
            "on_track": on_track,
            "drives": len(drives),
            "starts": comparison.starts,
            "replayed": comparison.replayed(),
            "horizons": comparison.to_dict(),
        }
        if on_track < ANOTHER_TRACK:
            self.stderr.write(
                f"Only {on_track:.0%} of the recorded positions lie on {geometry.name}. The figures stand, "
                "for the ground is flat, but the trace was recorded on another track."
            )
        if as_json:
            self.stdout.write(json.dumps(report, indent=2))
        else:
            self._table(report)

    def _table(self, report: dict[str, Any]) -> None:
        physics = report["physics"]
        self.stdout.write(
            f"{report['trace']} on {report['track']}: {report['starts']} start states in {report['drives']} drives; "
            f"{physics['name']} {physics['version']}, engine {report['engine']}\n\n"
        )
        self.stdout.write("                    our car                        bicycle")
        self.stdout.write("after    starts     median         p90             median         p90")
        for horizon, found in report["horizons"].items():
            if not report["replayed"][horizon]:
                continue
            cells = [
                f"{found[prefix + 'position_m'][figure]:5.3f} m {found[prefix + 'heading_deg'][figure]:5.1f}°"
                for prefix in ("", "bicycle_")
                for figure in ("median", "p90")
            ]
            self.stdout.write(f"{horizon:>4} s {report['replayed'][horizon]:>9}   " + "  ".join(cells))


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except OSError as error:
        raise Refusal.unreadable(error, path) from error
