"""``manage.py import_track FILE.npy``: put a track of the community into the catalogue."""

import json
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.utils import timezone

from core.management.base import JsonCommand, Refusal
from paddock.geometry.files import MAX_BYTES
from tracks.models import TrackLook
from tracks.services import import_track


class Command(JsonCommand):
    """Exits 2, with the reason's code, when the file cannot be read or is no track."""

    help = (
        "Import a track: the community's .npy format (six columns in metres: centre, inner, outer), or a CSV centre "
        "line with widths."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("file", metavar="FILE", type=Path)
        parser.add_argument("--name", help="what racers call it (default: the file's name)")
        parser.add_argument("--slug", help="its address (default: made from the name)")
        parser.add_argument("--description", default="", help="one or two sentences for its page")
        parser.add_argument(
            "--look", choices=TrackLook.values, default=TrackLook.OFFICIAL.value, help="default: %(default)s"
        )
        parser.add_argument("--open", action="store_true", help="the track ends: it is driven from start to end")
        parser.add_argument("--scale", type=float, default=1.0, help="what its metres are multiplied by (default: 1)")
        parser.add_argument(
            "--least-width",
            type=float,
            default=0.0,
            metavar="METRES",
            help="narrower places are widened to it",
        )
        parser.add_argument("--json", action="store_true", help="print the track as JSON")

    def handle(self, *args: Any, **options: Any) -> None:
        path: Path = options["file"]
        try:
            with path.open("rb") as file:
                data = file.read(MAX_BYTES + 1)
        except OSError as error:
            raise Refusal.unreadable(error, path) from None
        track = import_track(
            data=data,
            name=options["name"] if options["name"] is not None else path.stem.replace("_", " "),
            owner=None,
            now=timezone.now(),
            slug=options["slug"],
            description=options["description"],
            look=options["look"],
            is_open=options["open"],
            scale=options["scale"],
            least_width_m=options["least_width"],
        )
        if options["json"]:
            fields = ("slug", "name", "length_m", "width_m", "direction", "is_open", "look", "fingerprint")
            self.stdout.write(json.dumps({field: getattr(track, field) for field in fields}))
        else:
            self.stdout.write(
                f"{track.slug}: {track.name}, {track.length_m:.2f} m long, {track.width_m:.2f} m wide, "
                f"{track.direction}{', open' if track.is_open else ''}"
            )
