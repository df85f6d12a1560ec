"""What pages of seasons and notices follow on the stream (:mod:`core.streams`)."""

from __future__ import annotations

from collections.abc import Sequence

from core.events import Event
from core.streams import Topic, register_moves, register_topic

from .models import Round


def register() -> None:
    """``season:ID`` for everybody: seasons and their races are public."""
    register_topic(Topic("season", lambda viewer, key: True))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    """What happens in a race moves the season that it belongs to."""
    races = {event.race for event in events if event.race is not None}
    if not races:
        return {}
    seasons = dict(Round.objects.filter(race__in=races).values_list("race_id", "season_id"))
    return {event.pk: {f"season:{seasons[event.race]}"} for event in events if event.race in seasons}
