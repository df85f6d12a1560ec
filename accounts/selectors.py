"""Who has used how much, for admins; and the invitation that a visitor holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.conf import settings
from django.contrib.auth import get_user_model
from django.db.models import QuerySet

from .models import RacerQuota, SignUpInvitation
from .quotas import Quota, Usage, all_quotas

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


@dataclass(frozen=True)
class RacerUsage:
    """One row of the admins' page: a racer, and all their quotas in the order of the columns."""

    racer: Racer
    usage: list[Usage]


def can_see_usage(viewer: Racer | AnonymousUser, racer: Racer) -> bool:
    """Whether ``viewer`` may see how much ``racer`` has used: the racer, and admins. Twin of
    :func:`racers_whose_usage_is_seen_by`."""
    return viewer.pk is not None and (viewer.pk == racer.pk or viewer.is_staff)


def racers_whose_usage_is_seen_by(viewer: Racer | AnonymousUser) -> QuerySet[Racer]:
    """All racers whose usage ``viewer`` may see. Twin of :func:`can_see_usage`."""
    racers = get_user_model().objects.all()
    if viewer.pk is None:
        return racers.none()
    return racers if viewer.is_staff else racers.filter(pk=viewer.pk)


def racers_by_use(quota: Quota, now: datetime) -> list[int]:
    """Ids of all racers who have used any of ``quota``, the greatest use first."""
    used = quota.count(None, now)
    return sorted((pk for pk, value in used.items() if value), key=lambda pk: (-used[pk], pk))


def usage_rows(racers: Iterable[Racer], now: datetime) -> list[RacerUsage]:
    """All quotas of these racers, in their order: as many queries for one racer as for all."""
    racers = list(racers)
    ids = [racer.pk for racer in racers]
    own = {
        (racer, name): limit
        for racer, name, limit in RacerQuota.objects.filter(racer__in=ids).values_list("racer", "name", "limit")
    }
    quotas = all_quotas()
    used = {quota.name: quota.count(ids, now) for quota in quotas}
    return [
        RacerUsage(
            racer,
            [
                Usage(
                    quota,
                    used[quota.name].get(racer.pk, 0),
                    own.get((racer.pk, quota.name), getattr(settings, quota.setting)),
                    (racer.pk, quota.name) in own,
                )
                for quota in quotas
            ],
        )
        for racer in racers
    ]


def open_invitation(code: str, now: datetime) -> SignUpInvitation | None:
    """The invitation with this code, if somebody may still sign up with it."""
    found = SignUpInvitation.objects.filter(code=code).first() if code else None
    return found if found is not None and found.is_open(now) else None
