"""``manage.py export_season``: the official rounds of a season as a folder of CSV files."""

from argparse import ArgumentParser
from pathlib import Path

from django.core.management.base import BaseCommand, CommandError

from core.management.base import REFUSED
from league.history.season_export import export_season
from league.models import Season
from paddock.errors import UserFault


class Command(BaseCommand):
    """Writes what ``import_season`` reads again, in the columns of the old service's own export."""

    help = "Write the official results of a season to a folder: races.csv and a file of results for each race."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("season", help="the season's address")
        parser.add_argument("folder", type=Path, help="a folder that is new or empty")

    def handle(self, *, season: str, folder: Path, **options: object) -> None:
        row = Season.objects.filter(slug=season).first()
        if row is None:
            known = ", ".join(Season.objects.order_by("slug").values_list("slug", flat=True)) or "none"
            raise CommandError(f"There is no season {season}. There is: {known}.")
        try:
            left_out = export_season(season=row, folder=folder)
        except UserFault as fault:
            raise CommandError(f"{fault.code}: {fault}", returncode=REFUSED) from fault
        for round_ in left_out:
            self.stderr.write(f"Left out, not official yet: {round_.race.name}")
        self.stdout.write(f"{row.name}: {row.rounds.count() - len(left_out)} races in {folder}")
