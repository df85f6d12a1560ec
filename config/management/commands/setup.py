"""``manage.py setup``: everything that a new or upgraded site needs before its programs start."""

import getpass
import os
import sys
from typing import Any

from django.core.exceptions import ValidationError
from django.core.management.base import BaseCommand, CommandError, CommandParser
from django.utils import timezone

from config.operations.setup import NO_ADMIN, prepare_site

PASSWORD = "DJANGO_SUPERUSER_PASSWORD"  # the name that Django's createsuperuser reads


class Command(BaseCommand):
    help = (
        "Migrate the database, collect the static files, load the catalogue of tracks, open the first season and "
        f"create the first admin. Repeat it at each upgrade. The password comes from {PASSWORD} or the terminal."
    )
    requires_system_checks = []  # the checks run once the database is there

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("--admin", default="", metavar="ALIAS", help="create this admin unless the account exists")
        parser.add_argument(
            "--email", default="", metavar="ADDRESS", help="the admin's e-mail address; it counts as confirmed"
        )
        parser.add_argument("--no-input", "--noinput", action="store_true", help="ask nothing at the terminal")

    def handle(self, *args: Any, admin: str, email: str, no_input: bool, **options: Any) -> None:
        os.umask(0o077)
        prepare_site(self, now=timezone.now())
        self._create_admin(admin, email, asks=not no_input and sys.stdin.isatty())
        self.stdout.write("Setup is complete.")

    def _create_admin(self, alias: str, email: str, asks: bool) -> None:
        from accounts.models import Racer
        from accounts.signing_in.services import create_admin

        admins = Racer.objects.filter(is_superuser=True, is_active=True)
        if not alias and (admins.exists() or not asks):
            if not admins.exists():
                self.stdout.write(NO_ADMIN)
            return
        if admins.filter(alias__iexact=alias).exists():
            self.stdout.write(f"The admin {alias} exists.")
            return
        password = os.environ.get(PASSWORD, "")
        if asks:
            alias = alias or input("Alias of the first admin: ")
            email = email or input("E-mail address: ")
            password = password or _ask_password()
        elif not (email and password):
            raise CommandError(f"A new admin needs --email and {PASSWORD}, or run setup at a terminal.")
        try:
            racer = create_admin(alias=alias, email=email, password=password)
        except ValidationError as error:
            raise CommandError(f"The admin was not created: {' '.join(error.messages)}") from None
        self.stdout.write(f"The admin {racer.alias} was created.")


def _ask_password() -> str:
    password = getpass.getpass("Password: ")
    if getpass.getpass("Password (again): ") != password:
        raise CommandError("The two passwords differ.")
    return password
