"""Delete accounts for good, or list those that were deleted."""

from typing import Any

from django.core.management.base import CommandParser
from django.db.models import Q
from django.utils import timezone

from accounts.leaving.services import delete_account
from accounts.models import DeletedAccount, Racer
from core.management.base import JsonCommand
from paddock.errors import UserFault


class Command(JsonCommand):
    """``delete_account ALIAS...``, ``delete_account --id ID...`` and ``delete_account --list``."""

    help = "Delete accounts for good; results stay without the name. --list: the ids of the accounts deleted so far."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("racers", nargs="*", metavar="ALIAS")
        parser.add_argument("--id", nargs="+", type=int, default=[], help="ids of racers, as --list prints them")
        parser.add_argument("--list", action="store_true", help="one id a line with the time, for use after a restore")

    def handle(self, *args: Any, **options: Any) -> None:
        if options["list"]:
            for one in DeletedAccount.objects.order_by("deleted_at"):
                self.stdout.write(f"{one.pk} {one.deleted_at:%Y-%m-%d %H:%M:%S}")
        named = [*(Q(alias__iexact=alias) for alias in options["racers"]), *(Q(pk=pk) for pk in options["id"])]
        for wanted in named:
            racer = Racer.objects.filter(wanted).first()
            if racer is None:
                raise UserFault("team_no_such_racer")
            delete_account(racer=racer, by=None, now=timezone.now())
            self.stdout.write(f"Deleted: {racer.pk}")
