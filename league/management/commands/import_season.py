"""``manage.py import_season``: a recorded season becomes races, racers and standings of this site."""

from argparse import ArgumentParser
from decimal import Decimal
from json import dumps
from pathlib import Path
from typing import Any

from django.utils import timezone

from core.management.base import JsonCommand
from league.history.proof import SeasonTotals, proof_of, total_proof
from league.history.season_import import import_folder

# options of the command by the setting of a season that each is
SETTINGS = {
    "promotion_percent": ("--cut", Decimal, "per cent of an open race that are promoted (default: 10)"),
    "finale_size": ("--finale", int, "cars in a finale (default: 16)"),
    "championship_places": ("--places", int, "places in the championship from each finale (default: 3)"),
    "drop_worst": ("--drop", int, "worst results dropped in the standings (default: 0)"),
}


class Command(JsonCommand):
    """Imports all or nothing; importing the same files again changes nothing and prints the same."""

    help = (
        "Import seasons from a folder with races.csv and a file of results for each race, work out promotions, finales "
        "and qualification by our own rules, and print where these agree with the record."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("folder", type=Path, help="the folder with races.csv")
        parser.add_argument("--season", help="only this season of races.csv (default: all)")
        parser.add_argument("--json", action="store_true", help="print JSON")
        parser.add_argument("--points", help="points by place, such as 25,18,15 (default: the usual ten)")
        for name, (option, kind, explanation) in SETTINGS.items():
            parser.add_argument(option, dest=name, type=kind, help=explanation)

    def handle(self, *, folder: Path, season: str | None, json: bool, points: str | None, **options: Any) -> None:
        settings = {name: options[name] for name in SETTINGS if options[name] is not None}
        if points is not None:
            settings["points"] = _points(points)
        seasons = import_folder(folder=folder, now=timezone.now(), season=season, **settings)
        proofs = [proof_of(one) for one in seasons]
        proof = proofs[0] if len(proofs) == 1 else total_proof(proofs)
        text = dumps(proof, indent=2, ensure_ascii=False) if json else "\n".join(_lines(proof))
        self.stdout.write(text)


def _points(text: str) -> list[int | str]:
    """The numbers of a list; what is none is left for the season to refuse."""
    return [int(one) if one.strip().isdecimal() else one for one in text.split(",")]


def _lines(proof: SeasonTotals) -> list[str]:
    found = (
        ("order", proof["order"], "pairs"),
        ("scores", proof["scores"], "checked"),
        ("promotion", proof["promotion"], "checked"),
        ("finale", proof["finale"], "places"),
    )
    return [
        f"{proof['races']} races, {proof['results']} results, {proof['racers']} racers",
        *(f"{name}: {counts['agree']} of {counts[of]} agree" for name, counts, of in found),
        f"championship: {proof['championship']} racers",
        *(f"note: {note}" for note in proof["notes"]),
    ]
