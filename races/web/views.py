"""Helpers that the race pages share."""

from collections.abc import Iterable
from copy import copy
from functools import cache
from typing import Any

from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404

from accounts.models import Racer, Viewer
from core.database.kept_queries import KeptQuery
from core.rate_limits import address_of, count
from core.streams.shared_pieces import shared_value
from evaluation.models import Evaluation, State
from races.boards.selectors.shared_boards import shared_race
from races.entries.selectors.visibility import can_organise, can_see_race, evaluations_visible_to, races_visible_to
from races.models import Race, Visibility
from races.web.spectator_links import may_watch, tokens_of

MOST_RUNS = 8  # that are shown together


def visible_race(request: HttpRequest, slug: str) -> Race:
    """The race, or 404 when there is none or the reader may not see it."""
    return get_object_or_404(races_visible_to(request.user), slug=slug)


def shown_race(request: HttpRequest, slug: str) -> Race:
    """The same for a page: a public race is read once for all readers, and each gets a copy."""
    race = shared_race(slug)
    return copy(race) if race.visibility == Visibility.PUBLIC else visible_race(request, slug)


def watched_race(request: HttpRequest, slug: str) -> Race:
    """The race whose live event the reader may watch: as :func:`visible_race`, or with a spectators' link."""
    race = get_object_or_404(Race.objects.select_related("track", "organiser"), slug=slug)
    if not (can_see_race(request.user, race) or may_watch(tokens_of(request), race)):
        raise Http404
    return race


def organised_race(request: HttpRequest, slug: str) -> Race:
    """The race, or 404 unless the reader organises it."""
    race = visible_race(request, slug)
    if not can_organise(request.user, race):
        raise Http404
    return race


def visible_evaluation(request: HttpRequest, public_id: str) -> Evaluation:
    """The evaluation with its result and its race, or 404 when there is none or the reader may not see it."""
    return get_object_or_404(_evaluations(request.user), public_id=public_id)


def visible_evaluations(request: HttpRequest, public_ids: Iterable[str]) -> dict[str, Evaluation]:
    """Those of the evaluations, at most :data:`MOST_RUNS`, that the reader may see, by id, with result and model.
    One query."""
    wanted = [each for each in public_ids if "\0" not in each]
    if not wanted:
        return {}
    reader = request.user
    ids = (wanted + [""] * MOST_RUNS)[:MOST_RUNS]
    runs = _visible_runs(reader.is_authenticated, reader.is_staff)(ids=ids, racer=reader.pk)
    return {run.public_id: run for run in runs}


@cache
def _visible_runs(is_racer: bool, is_staff: bool) -> KeptQuery[Evaluation]:
    def rows(ids: Any, racer: Any = None) -> QuerySet[Evaluation]:
        runs = evaluations_visible_to(Racer(pk=racer, is_staff=is_staff) if is_racer else None)
        runs = runs.filter(public_id__in=[ids.at(number) for number in range(MOST_RUNS)])
        return runs.select_related("result", "model__owner").defer("track__npy")

    return KeptQuery(rows)


def public_evaluation(public_id: str) -> Evaluation | None:
    """A finished run that guests may see: one object for all readers, so nobody may change it."""

    def read() -> Evaluation | None:
        return _evaluations(None).filter(public_id=public_id, state=State.FINISHED).first()

    return shared_value(("public run", public_id), read)


def shown_evaluation(request: HttpRequest, public_id: str) -> Evaluation:
    """:func:`visible_evaluation` for a page: a public one is read once for all readers, and each gets a copy."""
    run = public_evaluation(public_id)
    return visible_evaluation(request, public_id) if run is None else copy(run)


def _evaluations(viewer: Viewer) -> QuerySet[Evaluation]:
    related = ("result", "model__network", "submission__entry__race", "submission__entry__racer", "duel__race")
    best = "submission__entry__best__evaluation__model"
    own = ("own__race__track", "own__owner", "own__submission__evaluation", "model__owner")
    return evaluations_visible_to(viewer).select_related(*related, best, *own)


def finished_evaluation(request: HttpRequest, public_id: str) -> Evaluation:
    """As :func:`shown_evaluation`, and 404 without a result."""
    shown = shown_evaluation(request, public_id)
    if shown.state != State.FINISHED:
        raise Http404
    return shown


def too_many(request: HttpRequest, action: str, rates: dict[str, str]) -> HttpResponse | None:
    """Status 429 above the rate limit, by racer or by a guest's address. ``rates``: by action
    (:func:`core.rate_limits.count`)."""
    key = str(request.user.pk) if request.user.is_authenticated else address_of(request)
    if count(f"races:{action}", key, rates[action]) is not None:
        return None
    response = HttpResponse(status=429)
    response["Retry-After"] = "60"
    return response


def downloaded(content: str | bytes, name: str, content_type: str) -> HttpResponse:
    return HttpResponse(
        content, content_type=content_type, headers={"Content-Disposition": f'attachment; filename="{name}"'}
    )
