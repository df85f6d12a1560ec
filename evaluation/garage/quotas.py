"""Quotas and sizes of models, networks, uploads and traces for each racer."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

from django.db.models import Count, Exists, F, Model, OuterRef, QuerySet, Subquery, Sum
from django.db.models.functions import Coalesce
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, only
from accounts.usage.storage import STORAGE_QUOTA, Shelf, megabytes

from ..models import Result, RivalResult, StoredFile, TrainedModel

# A model, its column with the name of a file, the way to the racer, and a filter
FileColumn = tuple[type[Model], str, str, Mapping[str, Any]]


def _models(racers: Racers, now: datetime) -> CountedRows:
    return _of(racers).filter(deleted_at=None).order_by().values_list("owner").annotate(Count("pk"))


def _networks(racers: Racers) -> list[CountedRows]:
    """With deleted models, whose networks are still stored. A network in several models of a racer counts once."""
    again = TrainedModel.objects.filter(owner=OuterRef("owner"), network=OuterRef("network"), pk__lt=OuterRef("pk"))
    models = _of(racers).filter(~Exists(again)).order_by()
    return [models.values(_racer=F("owner")).annotate(_sum=Sum("network__size")).values_list("_racer", "_sum")]


def _uploads(racers: Racers) -> list[CountedRows]:
    return sizes_of_files([(TrainedModel, "source_file", "owner", {})], racers)


def _traces(racers: Racers) -> list[CountedRows]:
    """Of all cars of a run, for its owner."""
    unsealed = {"result__evaluation__sealed": False}  # the size of a trace reveals how long its car drove
    tables: list[FileColumn] = [
        (Result, "trace", "evaluation__owner", {}),
        (Result, "bots", "evaluation__owner", {}),
        (RivalResult, "trace", "result__evaluation__owner", unsealed),
    ]
    return sizes_of_files(tables, racers)


def sizes_of_files(columns: Iterable[FileColumn], racers: Racers) -> list[CountedRows]:
    """Bytes of the files that these columns name, from the sizes noted when the files were written."""
    of_each = []
    for model, column, owner, wanted in columns:
        rows = only(model._default_manager.filter(**wanted).exclude(**{column: ""}), owner, racers)
        size = Subquery(StoredFile.objects.filter(name=OuterRef(column)).values("size")[:1])
        sums = rows.order_by().annotate(_bytes=Coalesce(size, 0)).values(_racer=F(owner)).annotate(_sum=Sum("_bytes"))
        of_each.append(sums.values_list("_racer", "_sum"))
    return of_each


def _of(racers: Racers) -> QuerySet[TrainedModel]:
    return only(TrainedModel.objects.all(), "owner", racers)


MODELS = Quota(1, "models", "MODELS_PER_RACER", _("Models in the garage"), _models)
STORAGE = Quota(2, STORAGE_QUOTA, "STORAGE_PER_RACER_MB", _("Stored files, MB"), megabytes, counts_rows=False)
NETWORKS = Shelf(1, "networks", _("Networks"), _networks)
UPLOADS = Shelf(5, "uploads", _("Uploaded files of models"), _uploads)
TRACES = Shelf(2, "traces", _("Sim-traces of runs"), _traces)
