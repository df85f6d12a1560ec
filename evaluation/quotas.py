"""How many models a racer may keep, and how much all that they leave may weigh; what networks and traces weigh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from datetime import datetime
from typing import Any

from django.db.models import Count, Model, OuterRef, QuerySet, Subquery, Sum
from django.db.models.functions import Coalesce
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota
from accounts.storage import Shelf, megabytes

from .models import Result, RivalResult, StoredFile, TrainedModel


def _models(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    return dict(_of(racers).filter(deleted_at=None).order_by().values_list("owner").annotate(Count("pk")))


def _networks(racers: Collection[int] | None) -> Mapping[int, float]:
    """With deleted models, whose networks are still there: else one racer could fill the disk by deleting. A network
    that a racer has in several models counts once."""
    used: dict[int, float] = defaultdict(float)
    networks = _of(racers).order_by().values_list("owner", "network", "network__size").distinct()
    for owner, _network, size in networks:
        used[owner] += size
    return used


def _uploads(racers: Collection[int] | None) -> Mapping[int, float]:
    """What models were uploaded as, which their owners get back to the byte."""
    return sizes_of_files(TrainedModel, "source_file", "owner", racers)


def _traces(racers: Collection[int] | None) -> Mapping[int, float]:
    """Of all cars of a run, for the racer whose run it is."""
    used: dict[int, float] = defaultdict(float)
    told = {"result__evaluation__sealed": False}  # how large a trace is tells how long its car drove
    tables: tuple[tuple[type[Model], str, str, dict[str, bool]], ...] = (
        (Result, "trace", "evaluation__owner", {}),
        (Result, "bots", "evaluation__owner", {}),
        (RivalResult, "trace", "result__evaluation__owner", told),
    )
    for model, column, owner, only in tables:
        for racer, size in sizes_of_files(model, column, owner, racers, **only).items():
            used[racer] += size
    return used


def sizes_of_files(
    model: type[Model], column: str, owner: str, racers: Collection[int] | None, **only: Any
) -> Mapping[int, float]:
    """Bytes of the files that ``column`` of these rows names, by racer id; ``owner``: the way to the racer. One query.

    Sizes are those that were noted when the files were written."""
    rows = model._default_manager.filter(**only).exclude(**{column: ""})
    if racers is not None:
        rows = rows.filter(**{f"{owner}__in": racers})
    size = Subquery(StoredFile.objects.filter(name=OuterRef(column)).values("size")[:1])
    rows = rows.order_by().annotate(_bytes=Coalesce(size, 0)).values(owner)
    return dict(rows.annotate(_sum=Sum("_bytes")).values_list(owner, "_sum"))


def _of(racers: Collection[int] | None) -> QuerySet[TrainedModel]:
    return TrainedModel.objects.all() if racers is None else TrainedModel.objects.filter(owner__in=racers)


MODELS = Quota(1, "models", "MODELS_PER_RACER", _("Models in the garage"), _models)
STORAGE = Quota(2, "storage_mb", "STORAGE_PER_RACER_MB", _("Stored files, MB"), megabytes)
NETWORKS = Shelf(1, "networks", _("Networks"), _networks)
UPLOADS = Shelf(5, "uploads", _("Uploaded files of models"), _uploads)
TRACES = Shelf(2, "traces", _("Sim-traces of runs"), _traces)
