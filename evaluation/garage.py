"""The garage as a list: searched, sorted, and with what each car did last."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from django.db.models import F, Max, OrderBy, OuterRef, Q, QuerySet, Subquery, TextChoices
from django.utils.translation import gettext_lazy as _

from .models import Evaluation, TrainedModel
from .selectors import models_of

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

LONGEST_SEARCH = 64

# The field's words for what trained a network, as people say them.
ALGORITHMS = {"clipped_ppo": "PPO", "sac": "SAC"}


class GarageSort(TextChoices):
    """What a garage may be sorted by."""

    NEWEST = "newest", _("newest first")
    DRIVEN = "driven", _("last run")
    NAME = "name", _("name")
    ALGORITHM = "algorithm", _("algorithm")
    WEIGHTS = "weights", _("fewest weights first")


_ORDERS: dict[str, tuple[OrderBy | str, ...]] = {
    GarageSort.NEWEST: ("-created_at", "-pk"),
    GarageSort.DRIVEN: (F("last_driven").desc(nulls_last=True), "-created_at", "-pk"),
    GarageSort.NAME: ("name", "pk"),
    GarageSort.ALGORITHM: (F("metadata__training_algorithm").asc(nulls_last=True), "name", "pk"),
    GarageSort.WEIGHTS: ("network__parameters", "name", "pk"),
}


def garage_of(racer: Racer | AnonymousUser, *, search: str = "", sort: str = "") -> QuerySet[TrainedModel]:
    """The racer's models whose name, description or algorithm holds ``search``, sorted as ``sort`` (of
    :class:`GarageSort`; newest first for any other word) says. Each with ``last_run_id``: that of the last run that
    its owner asked for, None for one that was never driven."""
    models, words = models_of(racer), search.strip()
    if words:
        named = [word for word, said in ALGORITHMS.items() if words.lower() in said.lower()]
        models = models.filter(
            Q(name__icontains=words) | Q(description__icontains=words) | Q(metadata__training_algorithm__in=named)
        )
    own = Evaluation.objects.filter(model=OuterRef("pk"), owner=OuterRef("owner")).order_by("-queued_at", "-pk")
    models = models.annotate(last_run_id=Subquery(own.values("pk")[:1]))
    if sort == GarageSort.DRIVEN:
        models = models.annotate(
            last_driven=Max(
                "evaluations__queued_at", filter=Q(evaluations__owner=F("owner"), evaluations__sealed=False)
            )
        )
    return models.order_by(*_ORDERS.get(sort, _ORDERS[GarageSort.NEWEST]))


def with_last_runs(models: Iterable[TrainedModel]) -> list[TrainedModel]:
    """Models of :func:`garage_of`, each with ``last_run``: the run itself with its track and its ``result`` (that has
    no more than its figures), or None."""
    listed = list(models)
    wanted = [run for model in listed if (run := getattr(model, "last_run_id", None)) is not None]
    runs = Evaluation.objects.filter(pk__in=wanted).select_related("track", "result")
    figures = ("public_id", "state", "reason_code", "ended_at", "track__name", "track__slug")
    own = ("result__best_lap_ms", "result__complete_laps", "result__evaluation")
    found = runs.only(*figures, *own).in_bulk() if wanted else {}
    for model in listed:
        model.last_run = found.get(getattr(model, "last_run_id", None))  # type: ignore[attr-defined]
    return listed


def algorithm_of(metadata: dict) -> str:
    """What trained a network, as people say it; ``""`` where its metadata do not tell."""
    named = metadata.get("training_algorithm")
    return ALGORITHMS.get(named, named) if isinstance(named, str) else ""
