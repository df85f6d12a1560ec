"""``manage.py run``: runs the site, a worker and everything they need in the foreground."""

import os
import sys
from argparse import ArgumentParser

from django.conf import settings
from django.core.management.base import BaseCommand, OutputWrapper
from django.utils import timezone

from config.operations.listen_address import HOST, PORT, port
from config.operations.run import StopSignal, run_site, stop_on_signals
from config.operations.setup import NO_ADMIN, prepare_site


class Command(BaseCommand):
    help = "Run the site, a worker and the bundled broker in the foreground. Ctrl-C stops all of them."
    requires_system_checks = []  # the checks run once the database is there

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--host", default=HOST, help="address to listen on (default: this machine only)")
        parser.add_argument("--port", type=port, default=PORT, help="port to listen on (default 8000)")

    def handle(self, *, host: str, port: int, **options: object) -> None:
        stop_on_signals()
        if settings.LOG_FORMAT == "json":
            from core.logs.json_lines import JsonOutput  # loads a library

            self.stdout = OutputWrapper(JsonOutput(sys.stdout))  # type: ignore[arg-type]
        try:
            status = run_site(host, port, self._prepare)
        except StopSignal as stopped:
            self.stdout.write("\nStopped.")  # the preparation may have ended within a line
            self.stdout.flush()
            os._exit(stopped.status)  # to give back 100 MB object by object would take half a second
        self.stdout.write("Stopped.")
        sys.exit(status)

    def _prepare(self) -> None:
        from accounts.models import Racer

        prepare_site(self, now=timezone.now())
        if not Racer.objects.filter(is_superuser=True, is_active=True).exists():
            self.stdout.write(NO_ADMIN)
        self.stdout.write("Starting the programs")
