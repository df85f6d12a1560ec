"""How many tracks a racer may import."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime

from django.db.models import Count
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota

from .models import Track


def _tracks(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    mine = Track.objects.exclude(owner=None)
    if racers is not None:
        mine = mine.filter(owner__in=racers)
    return dict(mine.order_by().values_list("owner").annotate(Count("pk")))


TRACKS = Quota(3, "tracks", "TRACKS_PER_RACER", _("Imported tracks"), _tracks)
