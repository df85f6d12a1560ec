"""How much of their quotas racers have used."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType

from core.streams.shared_pieces import shared_value

from ..models import Racer, RacerQuota
from ..quotas import Quota, Usage, all_quotas, amounts, site_limit

Counts = Mapping[str, Mapping[int, float]]


@dataclass(frozen=True)
class RacerUsage:
    """A racer with their use of all quotas, in the order of the pages."""

    racer: Racer
    usage: list[Usage]


def racers_by_use(quota: Quota, now: datetime) -> list[int]:
    """Ids of all racers who have used any of ``quota``, the greatest use first."""
    used = amounts([quota], None, now)[quota.name]
    return sorted((pk for pk, value in used.items() if value), key=lambda pk: (-used[pk], pk))


def usage_of(
    racer: Racer, now: datetime, only: Collection[str] | None = None, counted: Counts = MappingProxyType({})
) -> list[Usage]:
    """All shown quotas of one racer, or those of the names in ``only``, shown or not. ``counted``: the use of quotas
    that the caller has counted, by their names."""
    return usage_rows([racer], now, only, counted)[0].usage


def usage_rows(
    racers: Iterable[Racer],
    now: datetime,
    only: Collection[str] | None = None,
    counted: Counts = MappingProxyType({}),
) -> list[RacerUsage]:
    """All shown quotas of these racers, or those of the names in ``only``: as many queries for one racer as for all."""
    racers = list(racers)
    ids = [racer.pk for racer in racers]
    limited = shared_value("racers with limits", lambda: frozenset(RacerQuota.objects.values_list("racer", flat=True)))
    limits = RacerQuota.objects.filter(racer__in=limited.intersection(ids)).values_list("racer", "name", "limit")
    own = {(racer, name): limit for racer, name, limit in limits}
    quotas = all_quotas(only)
    used = amounts([quota for quota in quotas if quota.name not in counted], ids, now) | dict(counted)

    def usage(racer: int, quota: Quota) -> Usage:
        limit = own.get((racer, quota.name))
        amount = used[quota.name].get(racer, 0)
        return Usage(quota, amount, site_limit(quota) if limit is None else limit, limit is not None)

    return [RacerUsage(racer, [usage(racer.pk, quota) for quota in quotas]) for racer in racers]
