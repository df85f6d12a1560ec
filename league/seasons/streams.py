"""Stream topics of seasons and notices (:mod:`core.streams`)."""

from collections.abc import Sequence

from core.events import Event
from core.streams import Topic, register_moves, register_topic

from ..events import SEASON_DRAFTED
from ..models import Round, Season


def register() -> None:
    """``season:ID`` for everybody: seasons and their races are public."""
    register_topic(Topic("season", lambda viewer, key: True))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    """An event of a race moves its season; a draft moves itself and the season that it continues."""
    moved: dict[int, set[str]] = {}
    races = {event.race for event in events if event.race is not None}
    if races:
        seasons = dict(Round.objects.filter(race__in=races).values_list("race_id", "season_id"))
        moved = {event.pk: {f"season:{seasons[event.race]}"} for event in events if event.race in seasons}
    drafted = {event.pk: event.subject for event in events if event.kind == SEASON_DRAFTED.name}
    if drafted:
        rows = Season.objects.filter(slug__in=drafted.values()).values_list("slug", "pk", "follows_id")
        drafts = {slug: {f"season:{season}" for season in pair if season} for slug, *pair in rows}
        moved |= {pk: drafts[slug] for pk, slug in drafted.items() if slug in drafts}
    return moved
