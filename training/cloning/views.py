"""The page of shared models."""

from collections.abc import Iterable
from dataclasses import dataclass

from django.contrib.auth.decorators import login_required
from django.db.models import Min, Q, QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from core.pages.pager import LeanPaginator
from evaluation.models import Evaluation, TrainedModel
from evaluation.selectors import shared_models
from races.boards.track_figures import standard_races
from races.entries.selectors.visibility import evaluations_visible_to

SHARED_PER_PAGE = 30
LONGEST_SEARCH = 64


@dataclass(frozen=True)
class BestLap:
    milliseconds: int
    track: str


@login_required
@require_safe
def shared(request: HttpRequest) -> HttpResponse:
    """All shared models, the latest first; ``q`` looks for a name or a racer."""
    asked = request.GET.get("q", "").replace("\x00", "").strip()[:LONGEST_SEARCH]
    models = shared_models(request.user)
    if asked:
        models = models.filter(Q(name__icontains=asked) | Q(owner__alias__icontains=asked))
    page = LeanPaginator(models, SHARED_PER_PAGE).get_page(request.GET.get("page"))
    rows = list(page.object_list)
    laps = best_laps(evaluations_visible_to(request.user), rows)
    context = {"page": page, "rows": [(model, laps.get(model.pk)) for model in rows], "asked": asked}
    return render(request, "training/cloning/shared.html", context)


def best_laps(evaluations: QuerySet[Evaluation], models: Iterable[TrainedModel]) -> dict[int, BestLap]:
    """Each model's best lap in standard races, by the model's key: the one of the highest mean speed, as laps of two
    tracks do not compare by time."""
    standard = evaluations.filter(submission__entry__race__in=standard_races(), submission__entry__withdrawn_at=None)
    driven = (
        standard.filter(model__in=models, result__best_lap_ms__isnull=False, track__length_m__gt=0)
        .order_by()
        .values_list("model_id", "track__name", "track__length_m")
        .annotate(best=Min("result__best_lap_ms"))
    )
    fastest: dict[int, tuple[float, BestLap]] = {}
    for model_id, track, length_m, best in driven:
        speed = length_m / best
        if model_id not in fastest or speed > fastest[model_id][0]:
            fastest[model_id] = speed, BestLap(best, track)
    return {model_id: lap for model_id, (_, lap) in fastest.items()}
