"""``manage.py restore``: an empty place becomes the site that a backup holds."""

import os
from argparse import ArgumentParser
from json import dumps
from pathlib import Path
from typing import Any

from django.conf import settings

from config.operations.backup.restoring import restore
from config.operations.data_lock import hold_data
from core.management.base import JsonCommand, Ticker, ended_in_good_order


class Command(JsonCommand):
    help = "Restore a file that manage.py backup wrote into an empty database and an empty storage."
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("file", type=Path, help="the backup")
        parser.add_argument("--json", action="store_true", help="print what was restored as JSON")

    def handle(self, *, file: Path, json: bool, verbosity: int, **options: Any) -> None:
        os.umask(0o077)
        lock = hold_data(settings.DATA_DIR / "run.lock")
        with lock, ended_in_good_order():
            restored = restore(path=file, tell=Ticker(self.stderr, quiet=verbosity < 1))
        if json:
            document = {"made_at": restored.made_at, "files": restored.files, "lost": restored.lost}
            self.stdout.write(dumps(document, indent=2))
        else:
            self.stdout.write(
                f"Restored what was there at {restored.made_at}: the database and {restored.files} files."
            )
        if restored.lost:
            self.stderr.write(f"{len(restored.lost)} files had been lost before the backup was made.")
