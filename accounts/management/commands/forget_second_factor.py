"""Remove the second factors of a racer, so that they can log in again."""

from typing import Any

from django.core.management.base import BaseCommand, CommandError, CommandParser

from accounts.models import Racer
from accounts.signing_in.second_factor import forget_second_factor


class Command(BaseCommand):
    """``forget_second_factor ALIAS``."""

    help = "Take the second factor of a racer away: app, passkeys and codes. The password alone opens the account then."

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("alias")

    def handle(self, *args: Any, **options: Any) -> None:
        racer = Racer.objects.filter(alias__iexact=options["alias"]).first()
        if racer is None:
            raise CommandError(f"There is no racer {options['alias']!r}.")
        if not forget_second_factor(racer=racer):
            raise CommandError(f"{racer.alias} has no second factor.")
        self.stdout.write(f"{racer.alias} logs in with the password alone.")
