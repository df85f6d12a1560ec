"""What one racer may use of the site: the site's limits, and what an admin has set for a single racer instead.

Each room registers what it limits when the site starts, with the function that counts; it refuses by the same two
functions that pages and API show, :func:`limit_of` and :func:`used_by`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.conf import settings

if TYPE_CHECKING:
    from django.utils.functional import _StrPromise

    from accounts.models import Racer

# Numbers used by racer id, of these racers or of all; who has used nothing may be left out.
Count = Callable[[Collection[int] | None, datetime], Mapping[int, float]]


@dataclass(frozen=True)
class Quota:
    """One thing that is limited for each racer.

    ``setting`` names the site's limit, ``label`` says what is counted, with its unit. ``shown`` may say that the site
    has no such thing at all; pages show quotas by ``place``.
    """

    place: int
    name: str
    setting: str
    label: str | _StrPromise
    count: Count
    shown: Callable[[], bool] = lambda: True


@dataclass(frozen=True)
class Usage:
    """How much of a quota a racer has used. ``own`` says that an admin has set the limit for this racer."""

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


def all_quotas() -> tuple[Quota, ...]:
    """Every quota that this site has, in the order of the pages."""
    return tuple(quota for quota in _in_order() if quota.shown())


def name_choices() -> list[tuple[str, object]]:
    """Names and labels for a form."""
    return [(quota.name, quota.label) for quota in _in_order()]


def limit_of(racer: Racer, name: str) -> int:
    """How much of the quota ``name`` the racer may use. Raises KeyError for an unknown quota."""
    quota = _quotas[name]
    own = racer.quotas.filter(name=name).values_list("limit", flat=True).first() if racer.pk else None
    return _site_limit(quota) if own is None else own


def used_by(racer: Racer, name: str, now: datetime) -> float:
    """How much of the quota ``name`` the racer has used. Raises KeyError for an unknown quota."""
    return _quotas[name].count([racer.pk], now).get(racer.pk, 0)


def usage_of(racer: Racer, now: datetime, only: Collection[str] | None = None) -> list[Usage]:
    """All quotas of one racer, or those of the names in ``only``."""
    own = dict(racer.quotas.values_list("name", "limit"))
    return [
        Usage(
            quota,
            quota.count([racer.pk], now).get(racer.pk, 0),
            own.get(quota.name, _site_limit(quota)),
            quota.name in own,
        )
        for quota in all_quotas()
        if only is None or quota.name in only
    ]


def _in_order() -> list[Quota]:
    return sorted(_quotas.values(), key=lambda quota: quota.place)


def _site_limit(quota: Quota) -> int:
    return getattr(settings, quota.setting)
