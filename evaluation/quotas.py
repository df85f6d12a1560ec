"""How many models a racer may keep, and how much their networks may weigh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from datetime import datetime

from django.db.models import Count, QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota

from .models import TrainedModel

MEGABYTE = 1024 * 1024


def _models(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    return dict(_of(racers).filter(deleted_at=None).order_by().values_list("owner").annotate(Count("pk")))


def _storage_mb(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """With deleted models, whose networks are still there: else one racer could fill the disk by deleting. A network
    that a racer has in several models counts once."""
    used: dict[int, float] = defaultdict(float)
    networks = _of(racers).order_by().values_list("owner", "network", "network__size").distinct()
    for owner, _network, size in networks:
        used[owner] += size / MEGABYTE
    return used


def _of(racers: Collection[int] | None) -> QuerySet[TrainedModel]:
    return TrainedModel.objects.all() if racers is None else TrainedModel.objects.filter(owner__in=racers)


MODELS = Quota(1, "models", "MODELS_PER_RACER", _("Models in the garage"), _models)
STORAGE = Quota(2, "storage_mb", "STORAGE_PER_RACER_MB", _("Stored networks, MB"), _storage_mb)
