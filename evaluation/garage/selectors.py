"""The garage for pages: search, sorting, last runs and choices of models."""

from collections.abc import Iterable
from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.db.models import F, Max, OrderBy, OuterRef, Q, QuerySet, Subquery, TextChoices
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value

from ..models import Evaluation, TrainedModel
from ..selectors import garage_of as models_of_racer
from ..selectors import models_of, newest_shared, shared_models

LONGEST_SEARCH = 64
SHARED_OFFERED = 100  # of the models that others share, the latest; others are offered by their addresses

# The field's words for what trained a network, as people say them.
ALGORITHMS = {"clipped_ppo": "PPO", "sac": "SAC"}


class GarageSort(TextChoices):
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
    """The racer's models whose name, description or algorithm holds ``search``, sorted by ``sort``
    (:class:`GarageSort`; newest first for any other word). Each with ``last_run_id``, of the last run that its owner
    requested, or None."""
    models, words = models_of(racer), search.strip()
    if words:
        named = [word for word, label in ALGORITHMS.items() if words.lower() in label.lower()]
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
    """Models of :func:`garage_of`, each with ``last_run``: the run with its track and the figures of its ``result``, or
    None."""
    listed = list(models)
    wanted = [run for model in listed if (run := getattr(model, "last_run_id", None)) is not None]
    runs = Evaluation.objects.filter(pk__in=wanted).select_related("track", "result")
    figures = ("public_id", "state", "reason_code", "ended_at", "spec", "track__name", "track__slug")
    own = ("result__best_lap_ms", "result__complete_laps", "result__engine", "result__evaluation")
    found = runs.only(*figures, *own).in_bulk() if wanted else {}
    for model in listed:
        model.last_run = found.get(getattr(model, "last_run_id", None))  # type: ignore[attr-defined]
    return listed


def algorithm_of(metadata: dict) -> str:
    """What trained a network, as people say it; ``""`` where its metadata do not tell."""
    named = metadata.get("training_algorithm")
    return ALGORITHMS.get(named, named) if isinstance(named, str) else ""


_names: KeptQuery[tuple[str, str]] = KeptQuery(
    lambda racer: models_of_racer(racer).select_related(None).order_by("name").values_list("public_id", "name")
)


def cars_of(racer: Racer, *asked: str | None) -> list[tuple[Any, Any]]:
    """The cars that a racer may choose from, for a select: their own, the house's, the latest shared ones, and those
    ``asked`` for by their public ids."""
    mine = _names(racer=racer.pk)
    shared = shared_models(racer)
    cars = shared_value("cars of the house", lambda: list(shared.filter(owner__is_house=True).order_by("name")))
    house = [(model.public_id, model.name) for model in cars if model.owner_id != racer.pk]
    others = newest_shared(racer, SHARED_OFFERED, house=False)
    listed = {public_id for public_id, _name in mine + house} | {model.public_id for model in others}
    if wanted := [one for one in asked if one and one not in listed]:
        others += shared.filter(owner__is_house=False, public_id__in=wanted)
    shared_cars = [(model.public_id, f"{model.name} · {model.owner.alias}") for model in others]
    groups = [(_("My models"), mine), (_("House cars"), house), (_("Shared with me"), shared_cars)]
    return [(name, cars) for name, cars in groups if cars]
