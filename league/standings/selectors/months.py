"""The months of a season with their rounds."""

from collections.abc import Iterator
from dataclasses import dataclass

from django.shortcuts import get_object_or_404

from core.streams.shared_pieces import shared_value

from ...models import Round, Season, Stage


@dataclass(frozen=True)
class Month:
    """The races of one month of a season; None for a stage without a race. ``others``: other stages."""

    number: int
    name: str
    open: Round | None = None
    pro: Round | None = None
    finale: Round | None = None
    others: tuple[Round, ...] = ()

    def __iter__(self) -> Iterator[Round]:
        return (one for one in (self.open, self.pro, self.finale, *self.others) if one is not None)


def months_of(season: Season) -> list[Month]:
    """The months of a season in their order, each with its rounds and their races and tracks: one query."""
    months: dict[int, list[Round]] = {}
    for one in season.rounds.select_related("race__track").order_by("number", "race__opens_at", "pk"):
        one.season = season
        months.setdefault(one.number, []).append(one)
    made = []
    for number, rounds in months.items():
        by = {one.stage: one for one in rounds}
        main = (by.get(Stage.OPEN), by.get(Stage.PRO), by.get(Stage.FINALE))
        others = tuple(one for one in rounds if one not in main)
        made.append(Month(number, next((one.name for one in rounds if one.name), ""), *main, others))
    return made


def shared_season(slug: str) -> Season:
    """A season with the one before, at most a second old: no query for a single reader. Raises Http404."""
    seasons = Season.objects.select_related("follows")
    return shared_value(("season", slug), lambda: get_object_or_404(seasons, slug=slug))


def shared_months(slug: str) -> list[Month]:
    """:func:`months_of` a season, at most a second old."""
    return shared_value(("months", slug), lambda: months_of(shared_season(slug)))
