"""Delete what has been kept for long enough, or say what would go."""

import json
from typing import Any

from django.core.management.base import CommandParser
from django.utils import timezone

from core.management.base import JsonCommand
from core.personal_data.retention import retain
from core.personal_data.rules import all_policies


class Command(JsonCommand):
    """``retention [--dry-run] [--json]``."""

    help = "Delete what its retention policy no longer keeps, as the scheduler does each night. --dry-run: only count."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("--dry-run", action="store_true", help="delete nothing, print what would go")
        parser.add_argument("--json", action="store_true", help="print a list of objects")

    def handle(self, *args: Any, **options: Any) -> None:
        done = retain(all_policies(), now=timezone.now(), dry_run=options["dry_run"])
        if options["json"]:
            rows = [
                {"kind": one.policy.name, "days": one.policy.days, "rows": one.rows, "bytes": one.size} for one in done
            ]
            self.stdout.write(json.dumps(rows, indent=2))
            return
        verb = "would go" if options["dry_run"] else "deleted"
        for one in done:
            days = f"{one.policy.days} days" if one.policy.days else "for ever"
            self.stdout.write(f"{one.policy.name:22} {days:>10} {one.rows:>8} rows {one.size:>14} bytes {verb}")
