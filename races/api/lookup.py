"""What the API's addresses name, if the reader may see it. Everything else is not found."""

from __future__ import annotations

from django.http import Http404
from django.shortcuts import get_object_or_404
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request

from evaluation.models import Evaluation
from paddock.errors import UserFault

from ..models import Entry, Race
from ..selectors import can_organise, can_see_race, entry_of, evaluations_visible_to, races_visible_to
from ..spectators import may_watch, tokens_of


def visible_race(request: Request, slug: str) -> Race:
    """The race at ``slug``. Raises Http404."""
    return get_object_or_404(races_visible_to(request.user), slug=slug)


def watched_race(request: Request, slug: str) -> Race:
    """The race at ``slug`` whose live event the reader may watch, with a spectators' link too. Raises Http404."""
    race = get_object_or_404(Race.objects.select_related("track", "organiser"), slug=slug)
    if not (can_see_race(request.user, race) or may_watch(tokens_of(request._request), race)):
        raise Http404
    return race


def organised_race(request: Request, slug: str) -> Race:
    """The race at ``slug``, which the reader organises. Raises Http404, PermissionDenied."""
    race = visible_race(request, slug)
    if not can_organise(request.user, race):
        raise PermissionDenied()
    return race


def own_entry(request: Request, slug: str) -> Entry:
    """The reader's entry in the race at ``slug``. Raises Http404, UserFault("entry_missing")."""
    entry = entry_of(visible_race(request, slug), request.user)
    if entry is None:
        raise UserFault("entry_missing")
    return entry


def visible_evaluation(request: Request, public_id: str) -> Evaluation:
    """The evaluation with this id, with its race and result. Raises Http404."""
    evaluations = evaluations_visible_to(request.user).select_related(
        "submission__entry__race",
        "duel__race",
        "own__race__track",
        "own__owner",
        "own__submission__evaluation",
        "result",
    )
    return get_object_or_404(evaluations, public_id=public_id)
