"""The standings of a season as plain data, CSV and an Atom feed."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from django.utils.feedgenerator import Atom1Feed
from django.utils.translation import gettext as _

from races.exports import plain
from races.names import named

from .models import Season
from .selectors.overview import STANDINGS_OF, divisions_with_points, standings_table
from .selectors.seasons import Month

COLUMNS = ("division", "of", "place", "name", "country", "points", "rounds")
_FED = 10  # lines of each table in the feed


def standings_data(season: Season, months: Sequence[Month]) -> list[dict[str, Any]]:
    """Every line of every standings table, with the keys of :data:`COLUMNS`.

    ``of``: racers, countries, regions or teams; ``rounds``: for each official round of the division in order its
    ``race``, ``rank``, ``points`` and whether it is ``dropped``, None where the line has no points.
    """
    rows = []
    for division in divisions_with_points(months):
        for of in STANDINGS_OF:
            table = standings_table(season, division, of, months)
            for row in table.rows:
                cells = [
                    None
                    if cell is None
                    else {
                        "race": round_.race.slug,
                        "rank": cell[0].rank,
                        "points": cell[0].points,
                        "dropped": cell[1],
                    }
                    for round_, cell in zip(table.rounds, row.cells, strict=True)
                ]
                country = row.racer.country if row.racer is not None else ""
                values = (str(division.value), of, row.place, row.name, country, row.points, cells)
                rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows


def standings_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The lines as CSV; points of the rounds in one cell, separated by blanks, dropped ones in brackets.

    A name that a spreadsheet would take for a formula begins with an apostrophe.
    """
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for row in rows:
        cells = [plain(row[name]) for name in COLUMNS[:-1]]
        writer.writerow([*cells, " ".join(map(_cell, row["rounds"]))])
    return file.getvalue()


def standings_feed(season: Season, rows: Sequence[Mapping[str, Any]], *, address: Callable[[str], str]) -> Atom1Feed:
    """The first ten of each division's racers; an entry is new when somebody's points have changed."""
    page = f"{season.get_absolute_url()}standings/"
    feed = Atom1Feed(
        title=_("Standings of %(season)s") % {"season": named(season.name)},
        link=address(page),
        description=named(season.name),
        feed_url=address(f"{season.get_absolute_url()}standings.atom"),
    )
    latest = season.rounds.filter(closed_at__isnull=False).order_by("-closed_at").first()
    for row in rows:
        if row["of"] != STANDINGS_OF[0] or row["place"] > _FED or latest is None:
            continue
        text = _("%(place)s. %(name)s, %(points)s points") % row
        feed.add_item(
            title=f"{row['division']}: {text}",
            link=address(f"{page}?division={row['division']}"),
            description="",
            author_name=row["name"],
            unique_id=address(f"{page}#{row['division']}-{row['name']}-{row['points']}-{row['place']}"),
            updateddate=latest.closed_at,
            pubdate=latest.closed_at,
        )
    return feed


def _cell(cell: Mapping[str, Any] | None) -> str:
    if cell is None:
        return "-"
    return f"({cell['points']})" if cell["dropped"] else str(cell["points"])
