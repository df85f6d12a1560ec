"""The standings of a season as plain data, CSV and an Atom feed."""

import csv
import io
from collections.abc import Callable, Sequence
from typing import Annotated, TypedDict

from django.utils.feedgenerator import Atom1Feed
from django.utils.translation import gettext as _

from races.boards.exports import plain
from races.web.names import named

from ..models import Season
from .selectors.months import Month
from .selectors.standings import STANDINGS_OF
from .selectors.tables import StandingsTable, divisions_with_points, standings_table

_FED = 10  # lines of each table in the feed


class CellDocument(TypedDict):
    """What one official round gave to a line of standings."""

    race: str
    rank: int
    points: int
    dropped: Annotated[bool, "One of the worst results, which do not count."]


class StandingsLine(TypedDict):
    """A line of standings. ``rounds``: a cell for each official round of the division, None without points."""

    division: str
    of: str
    place: int
    name: str
    country: str
    points: int
    rounds: list[CellDocument | None]


COLUMNS = tuple(StandingsLine.__annotations__)


def standings_data(season: Season, months: Sequence[Month]) -> list[StandingsLine]:
    return [
        line
        for division in divisions_with_points(months)
        for of in STANDINGS_OF
        for line in standings_lines(standings_table(season, division, of, months), str(division.value), of)
    ]


def standings_lines(table: StandingsTable, division: str, of: str) -> list[StandingsLine]:
    return [
        {
            "division": division,
            "of": of,
            "place": row.place,
            "name": row.name,
            "country": row.racer.country if row.racer is not None else "",
            "points": row.points,
            "rounds": [
                cell and {"race": one.race.slug, "rank": cell[0].rank, "points": cell[0].points, "dropped": cell[1]}
                for one, cell in zip(table.rounds, row.cells, strict=True)
            ],
        }
        for row in table.rows
    ]


def standings_csv(rows: Sequence[StandingsLine]) -> str:
    """The lines as CSV; points of rounds in one cell, dropped ones in brackets. Formulas begin with an apostrophe."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for row in rows:
        *cells, _rounds = row.values()
        writer.writerow([*map(plain, cells), " ".join(map(_cell, row["rounds"]))])
    return file.getvalue()


def standings_feed(season: Season, rows: Sequence[StandingsLine], *, address: Callable[[str], str]) -> Atom1Feed:
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


def _cell(cell: CellDocument | None) -> str:
    if cell is None:
        return "-"
    return f"({cell['points']})" if cell["dropped"] else str(cell["points"])
