"""``manage.py audit``: writes the audit log to standard output."""

from argparse import ArgumentParser
from datetime import date
from typing import Any

from django.core.management.base import BaseCommand

from core.audit.models import AuditEntry
from races.audit.exports import FORMS
from races.audit.selectors import AuditFilter, in_order


class Command(BaseCommand):
    help = "Write the audit log to standard output, the oldest entry first."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--format", choices=[*FORMS], default="jsonl")
        parser.add_argument("--actor", default="", help="an alias, or # and an id")
        parser.add_argument("--action", default="", help="such as race.cancelled")
        parser.add_argument("--target", default="", help="a name, or kind:id")
        parser.add_argument("--since", type=date.fromisoformat, help="the first day, YYYY-MM-DD")
        parser.add_argument("--until", type=date.fromisoformat, help="the last day")

    def handle(self, *args: Any, **options: Any) -> None:
        wanted = AuditFilter(**{name: options[name] for name in ("actor", "action", "target", "since", "until")})
        _kind, lines = FORMS[options["format"]]
        entries = wanted(AuditEntry.objects.select_related("actor", "racer"))
        for line in lines(in_order(entries)):
            self.stdout.write(line, ending="")
