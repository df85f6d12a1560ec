"""The fields of a season's finales and of its championship."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from accounts.models import Racer
from races.models import RaceState

from ...models import ChampionshipPlace, FinalePlace, Round, Season, Stage
from .months import Month
from .outcomes import outcome_of


@dataclass(frozen=True)
class QualifiedField:
    """The field of a finale or of the championship: place and racer; ``official``: final, or as it stands."""

    round: Round | None
    places: list[tuple[int, Racer]]
    official: bool


@dataclass(frozen=True)
class MonthFields:
    """The field of a month's finale, and the racers who qualify in it."""

    month: Month
    finale: QualifiedField
    qualified: QualifiedField

    def is_over(self) -> bool:
        """Whether nothing of it will change: the finale, or the pro race without one, is official or cancelled."""
        last = self.qualified.round or self.finale.round
        return last is not None and (last.closed_at is not None or last.race.cancelled_at is not None)

    def has_begun(self, now: datetime) -> bool:
        """Whether the race that its field comes from has opened."""
        first = self.finale.round or self.qualified.round
        return first is not None and first.race.state_at(now) in (RaceState.OPEN, RaceState.CLOSED)


def fields_of(season: Season, months: Sequence[Month], now: datetime) -> tuple[list[MonthFields], QualifiedField]:
    """The fields of a season's finales, the latest month first, and of its championship, official or as they stand.

    Four queries, and at most four more for each race that is open or waits to become official.
    """
    everybody = ChampionshipPlace.objects.filter(season=season).order_by("round__race__closes_at", "place")
    official: dict[int, list[tuple[int, int]]] = defaultdict(list)
    finalists = FinalePlace.objects.filter(round__season=season).order_by("place")
    places: list[FinalePlace | ChampionshipPlace] = [*finalists, *everybody]
    for one in places:
        official[one.round_id].append((one.place, one.racer_id))
    found = [
        (month, _field(month.pro, season, official, now), _field(month.finale, season, official, now))
        for month in months
        if month.pro is not None or month.finale is not None
    ]
    ids = {racer for _month, *both in found for _round, places, _official in both for _place, racer in places}
    racers = Racer.objects.in_bulk(ids | {one.racer_id for one in everybody})

    def made(parts: tuple) -> QualifiedField:
        round_, places, official = parts
        return QualifiedField(round_, [(place, racers[racer]) for place, racer in places], official)

    shown = [MonthFields(month, made(field_), made(winners)) for month, field_, winners in reversed(found)]
    final = next((one for month in months for one in month if one.stage == Stage.CHAMPIONSHIP), None)
    total = [(number, racers[one.racer_id]) for number, one in enumerate(everybody, start=1)]
    return shown, QualifiedField(final, total, bool(total))


@dataclass(frozen=True)
class FieldsInTime:
    """The months of finales: ``next``, those that are on or the coming one; ``coming``, in time; ``past``, the latest
    first."""

    next: list[MonthFields]
    coming: list[MonthFields]
    past: list[MonthFields]


def fields_in_time(months: Iterable[MonthFields], now: datetime) -> FieldsInTime:
    """The months of :func:`fields_of` from the next finale on, and those that are over."""
    months = list(months)
    left = [one for one in reversed(months) if not one.is_over()]
    shown = [one for one in left if one.has_begun(now)] or left[:1]
    coming = [one for one in left if one not in shown]
    return FieldsInTime(shown, coming, [one for one in months if one.is_over()])


def _field(
    round_: Round | None, season: Season, official: Mapping[int, list[tuple[int, int]]], now: datetime
) -> tuple[Round | None, list[tuple[int, int]], bool]:
    """The round, place and racer of those that it moves on, and whether that is official."""
    if round_ is None:
        return None, [], False
    if round_.closed_at is not None:
        return round_, official.get(round_.pk, []), True
    if round_.race.state_at(now) not in (RaceState.OPEN, RaceState.CLOSED):
        return round_, [], False
    round_.season = season
    outcome = outcome_of(round_)
    return round_, list(enumerate(outcome.finale or outcome.qualified, start=1)), False
