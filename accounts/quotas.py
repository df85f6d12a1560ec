"""Limits on each racer: the site's, or an admin's for a single racer. Each room registers its own."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any, Protocol, TypeVar

from django.conf import settings
from django.db.models import Expression, Model, QuerySet, Value
from django.utils.functional import Promise

from core.database.kept_queries import KeptQuery

M = TypeVar("M", bound=Model)
# Rows of (racer id, number used), which share one query with those of other quotas
CountedRows = QuerySet[Any, tuple[int, int]]
# Ids of racers, an expression for the id of one, or None: all
Racers = Collection[int] | Expression | None
Counted = Mapping[int, float]
# Numbers used by racer id, of these racers or of all; those without use may be left out. Quotas with the same function
# are counted by one call, which returns the numbers of each by its name
Count = Callable[[Racers, datetime], Counted | Mapping[str, Counted] | CountedRows]


class QuotaOwner(Protocol):
    """A racer, with the limits that an admin has set for them."""

    @property
    def pk(self) -> Any: ...
    @property
    def quotas(self) -> Any: ...


@dataclass(frozen=True)
class Quota:
    """A limit for each racer. ``setting``: the site's limit; ``label``: the counted thing with its unit; ``shown``:
    whether the site has that thing at all; ``place``: the order on pages; ``counts_rows``: whether ``count`` returns a
    queryset."""

    place: int
    name: str
    setting: str
    label: str | Promise
    count: Count
    shown: Callable[[], bool] = lambda: True
    counts_rows: bool = True


@dataclass(frozen=True)
class Usage:
    """A racer's use of a quota. ``own``: whether an admin has set the limit for this racer."""

    quota: Quota
    used: float
    limit: int
    own: bool

    @property
    def name(self) -> str:
        return self.quota.name

    @property
    def percent(self) -> int:
        """Of the limit, 100 at most; a limit of nothing is used up."""
        return min(100, round(100 * self.used / self.limit)) if self.limit else 100

    @property
    def left(self) -> float:
        """What may still be used, 0 at least."""
        return max(0, self.limit - self.used)


_quotas: dict[str, Quota] = {}


def register(quota: Quota) -> None:
    """Make a quota known. Called when the site starts."""
    _quotas[quota.name] = quota


def all_quotas(only: Collection[str] | None = None) -> tuple[Quota, ...]:
    """The quotas that the site shows, or those of the names in ``only``."""
    return tuple(quota for quota in _in_order() if (quota.shown() if only is None else quota.name in only))


def name_choices() -> list[tuple[str, object]]:
    return [(quota.name, quota.label) for quota in _in_order()]


def limit_of(racer: QuotaOwner, name: str) -> int:
    """How much of the quota ``name`` the racer may use. Raises KeyError for an unknown quota."""
    quota = _quotas[name]
    own = racer.quotas.filter(name=name).values_list("limit", flat=True).first() if racer.pk else None
    return site_limit(quota) if own is None else own


def only(rows: QuerySet[M], owner: str, racers: Racers) -> QuerySet[M]:
    """The rows of these racers; ``owner``: their column or the way to it."""
    if racers is None:
        return rows
    return rows.filter(**{owner if isinstance(racers, Expression) else f"{owner}__in": racers})


def one_of(racers: Racers) -> int | None:
    """The id, if it is one racer's."""
    return next(iter(racers)) if isinstance(racers, Collection) and len(racers) == 1 else None


def used_by(racer: QuotaOwner, name: str, now: datetime) -> float:
    """How much of the quota ``name`` the racer has used. Raises KeyError for an unknown quota."""
    return amounts([_quotas[name]], [racer.pk], now)[name].get(racer.pk, 0)


def amounts(quotas: Sequence[Quota], racers: Racers, now: datetime) -> dict[str, dict[int, float]]:
    """By quota what these racers (or all) have used of it, by racer id."""
    used: dict[str, dict[int, float]] = {quota.name: {} for quota in quotas}
    counts = {quota.count for quota in quotas if not quota.counts_rows}
    counted: dict[Count, Any] = {count: count(racers, now) for count in counts}
    for quota in quotas:
        if not quota.counts_rows:
            used[quota.name].update(counted[quota.count].get(quota.name, counted[quota.count]))
    if with_rows := tuple(quota for quota in quotas if quota.counts_rows):
        one = one_of(racers)
        rows = _rows(with_rows, racers, now) if one is None else _rows_of_one(with_rows)(racer=one, now=now)
        for racer, value, name in rows:
            used[name][racer] = value
    return used


def _rows(quotas: Sequence[Quota], racers: Any, now: Any) -> QuerySet[Any, Any]:
    """Racer id, number used and the name of a quota. One query."""
    counted: Any = [quota.count(racers, now) for quota in quotas]
    rows = [found.annotate(_quota=Value(quota.name)) for quota, found in zip(quotas, counted, strict=True)]
    return rows[0].union(*rows[1:], all=True)


@cache
def _rows_of_one(quotas: tuple[Quota, ...]) -> KeptQuery[Any]:
    return KeptQuery(lambda racer, now=None: _rows(quotas, racer, now))


def _in_order() -> list[Quota]:
    return sorted(_quotas.values(), key=lambda quota: quota.place)


def site_limit(quota: Quota) -> int:
    return getattr(settings, quota.setting)
