"""The board of teams: each stands where its best car does."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice

from accounts.models import Team

from ..models import Entry, Race
from .boards import CLASSIFIED, board_entries

MOST = 10_000  # classified cars that are looked at


@dataclass
class TeamRow:
    """A team on a board. ``entries``: its classified cars, the best first; ``places``: theirs among all racers."""

    rank: int
    team: Team
    entries: list[Entry] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


def team_board(race: Race) -> list[TeamRow]:
    """Teams in the order of their best classified cars: two queries. A racer counts for the team that they are in."""
    ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).select_related("racer__team_membership__team")
    rows: dict[int, TeamRow] = {}
    for place, entry in enumerate(islice(ranked.iterator(chunk_size=1000), MOST), start=1):
        member = getattr(entry.racer, "team_membership", None)
        if member is None:
            continue
        entry.race = race
        row = rows.setdefault(member.team_id, TeamRow(len(rows) + 1, member.team))
        row.entries.append(entry)
        row.places.append(place)
    return list(rows.values())
