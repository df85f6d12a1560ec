"""Limits on each racer: the site's, or an admin's for a single racer. Each room registers its own."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

from django.conf import settings
from django.db.models import QuerySet, Value
from django.utils.functional import Promise

# Rows of (racer id, number used), which share one query with those of other quotas
CountedRows = QuerySet[Any, tuple[int, int]]
Counted = Mapping[int, float]
# Numbers used by racer id, of these racers or of all; those without use may be left out. Quotas with the same function
# are counted by one call, which returns the numbers of each by its name
Count = Callable[[Collection[int] | None, datetime], Counted | Mapping[str, Counted] | CountedRows]


class QuotaOwner(Protocol):
    """A racer, with the limits that an admin has set for them."""

    @property
    def pk(self) -> Any: ...
    @property
    def quotas(self) -> Any: ...


@dataclass(frozen=True)
class Quota:
    """A limit for each racer. ``setting``: the site's limit; ``label``: the counted thing with its unit; ``shown``:
    whether the site has that thing at all; ``place``: the order on pages."""

    place: int
    name: str
    setting: str
    label: str | Promise
    count: Count
    shown: Callable[[], bool] = lambda: True


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


def used_by(racer: QuotaOwner, name: str, now: datetime) -> float:
    """How much of the quota ``name`` the racer has used. Raises KeyError for an unknown quota."""
    return amounts([_quotas[name]], [racer.pk], now)[name].get(racer.pk, 0)


def amounts(quotas: Sequence[Quota], racers: Collection[int] | None, now: datetime) -> dict[str, dict[int, float]]:
    """By quota what these racers (or all) have used of it, by racer id."""
    used: dict[str, dict[int, float]] = {quota.name: {} for quota in quotas}
    counted = {count: count(racers, now) for count in {quota.count for quota in quotas}}
    rows = []
    for number, quota in enumerate(quotas):
        found: Any = counted[quota.count]
        if isinstance(found, QuerySet):
            rows.append(found.annotate(_quota=Value(number)))
        else:
            used[quota.name].update(found.get(quota.name, found))
    for racer, value, number in rows[0].union(*rows[1:], all=True) if rows else ():
        used[quotas[number].name][racer] = value
    return used


def _in_order() -> list[Quota]:
    return sorted(_quotas.values(), key=lambda quota: quota.place)


def site_limit(quota: Quota) -> int:
    return getattr(settings, quota.setting)
