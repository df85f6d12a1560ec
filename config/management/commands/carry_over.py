"""``manage.py carry_over``: the rows of a site from before 0.1.0 in a new database."""

from __future__ import annotations

import os
from argparse import ArgumentParser
from typing import Any

from django.conf import settings
from django.core.management import call_command
from django.core.management.base import BaseCommand

from config.carry_over import carry_over, look_at
from config.management import Refusal
from config.management.data_lock import hold_data
from paddock.errors import PaddockError


class Command(BaseCommand):
    """All of it or, where it is refused, nothing."""

    help = "Copy the database of a version before 0.1.0 into the site's own, which must be empty."
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("source", help="the old database: a SQLite file, or a URL such as postgres://...")

    def handle(self, *, source: str, verbosity: int, **options: Any) -> None:
        os.umask(0o077)
        with hold_data(settings.DATA_DIR / "run.lock"):
            try:
                look_at(source)
                call_command("migrate", interactive=False, verbosity=0)
                rows = carry_over(source, tell=self.stderr.write if verbosity > 1 else lambda line: None)
            except PaddockError as fault:
                raise Refusal(fault) from fault
        self.stdout.write(f"Carried over {sum(rows.values())} rows of {sum(map(bool, rows.values()))} tables.")
