"""``manage.py backup``: the whole site in one file, while it runs."""

import os
from argparse import ArgumentParser
from json import dumps
from pathlib import Path
from typing import Any

from django.utils import timezone

from config.operations.backup.making import back_up
from core.management.base import JsonCommand, Ticker, ended_in_good_order

LOST = 1  # also what is damaged
NAMED = 10


class Command(JsonCommand):
    """Exit status 1 when the backup is there and files were lost or damaged before it was made."""

    help = "Write database, stored files and secret key into one new file, with sums, while the site runs."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("file", type=Path, help="a file that is not there yet")
        parser.add_argument("--json", action="store_true", help="print what was made as JSON")

    def handle(self, *, file: Path, json: bool, verbosity: int, **options: Any) -> None:
        os.umask(0o077)
        with ended_in_good_order():
            made = back_up(path=file, now=timezone.now(), tell=Ticker(self.stderr, quiet=verbosity < 1))
        if json:
            document = {"file": str(made.path), "bytes": made.size, "files": made.files}
            self.stdout.write(dumps(document | {"lost": made.lost, "damaged": made.damaged}, indent=2))
        else:
            self.stdout.write(f"{made.path}: {made.size >> 20} MB, the database and {made.files} files")
        for how, names in (("Lost", made.lost), ("Damaged", made.damaged)):
            for name in names[:NAMED]:
                self.stderr.write(f"{how} before this backup was made: {name}")
            if len(names) > NAMED:
                self.stderr.write(f"... and {len(names) - NAMED} more")
        if made.lost or made.damaged:
            raise SystemExit(LOST)
