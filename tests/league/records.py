"""A small record that a test imports, and what it looks at before and after."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from accounts.models import Racer
from league.history.season_import import import_folder
from league.models import ChampionshipPlace, FinalePlace, Membership, RecordedResult, Round, RoundPoints, Season
from paddock.errors import UserFault
from races.models import Entry, Race
from tests.league.histories import START, month, read_csv, write_csv
from tracks.models import Track

FEW = [
    month(0, "open-qualifier", [(n, 30_000 + 1000 * n) for n in range(1, 31)]),
    month(1, "pro-qualifier", [(1, 40_000), (2, 41_000), (3, 42_000), (99, 43_000)]),
    month(1, "pro-finale", [(3, 9_000), (1, 9_500), (2, None)]),
]

RESULTS = FEW[0].file


def bring(folder: Path, now: datetime = START, **options: Any) -> list[Season]:
    """Import the folder at ``now``; returns its seasons."""
    return import_folder(folder=folder, now=now, **options)


def everything() -> dict[str, list]:
    """All rows that an import may write, by the name of their model."""
    models = (Season, Round, Race, Racer, Track, Entry, RecordedResult, Membership, FinalePlace)
    models += (ChampionshipPlace, RoundPoints)
    return {model.__name__: list(model.objects.order_by("pk").values()) for model in models}


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of every file below ``folder`` by its path."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(folder: Path, code: str | None = None, **options: Any) -> dict[str, Any]:
    """Import a folder that is refused with ``code``; returns what the reason names. Nothing of it is imported."""
    before = everything()
    with pytest.raises(UserFault) as caught:
        bring(folder, **options)
    assert code in (None, caught.value.code)
    assert everything() == before, "nothing is half imported"
    assert "?" not in str(caught.value)
    return caught.value.params


def change(folder: Path, name: str, at: int, /, **cells: str) -> None:
    """Write other cells into row ``at`` (the heading is row 1) of a file."""
    rows = read_csv(folder / name)
    rows[at - 2].update(cells)
    write_csv(folder / name, list(rows[0]), rows)
