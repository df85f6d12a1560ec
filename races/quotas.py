"""How many races a racer may hold."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime

from django.db.models import Count
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota

from .models import Race, RaceKind


def _races(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Community races that are neither over nor cancelled."""
    held = Race.objects.filter(kind=RaceKind.COMMUNITY, cancelled_at=None, closes_at__gt=now).exclude(organiser=None)
    if racers is not None:
        held = held.filter(organiser__in=racers)
    return dict(held.order_by().values_list("organiser").annotate(Count("pk")))


RACES = Quota(4, "races", "RACES_PER_RACER", _("Races held at a time"), _races)
