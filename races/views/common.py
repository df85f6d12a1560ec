"""What the race pages share."""

from __future__ import annotations

from allauth.core.internal import ratelimit
from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404
from django.utils.html import format_html
from django.utils.safestring import SafeString

from core.forms import explain
from evaluation.models import Evaluation
from paddock.errors import PaddockError
from races.models import Race
from races.selectors import can_organise, can_see_race, evaluations_visible_to, races_visible_to
from races.spectators import may_watch, tokens_of


def visible_race(request: HttpRequest, slug: str) -> Race:
    """The race, or 404 when there is none or the reader may not see it."""
    return get_object_or_404(races_visible_to(request.user), slug=slug)


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
    related = ("result", "model__network", "submission__entry__race", "submission__entry__racer", "duel__race")
    best = "submission__entry__best__evaluation__model"
    own = ("own__race__track", "own__owner", "own__submission__evaluation", "model__owner")
    found = evaluations_visible_to(request.user).select_related(*related, best, *own)
    return get_object_or_404(found, public_id=public_id)


def tell_fault(request: HttpRequest, fault: PaddockError) -> None:
    """Show a refusal at the top of the next page: its sentence."""
    messages.error(request, fault_text(fault), extra_tags="fault")


def fault_text(fault: PaddockError) -> SafeString:
    """The fault's sentence; programs find its code in ``data-code``."""
    return format_html('<span data-code="{}">{}</span>', fault.code, explain(fault))


def too_many(request: HttpRequest, action: str, rates: dict[str, str]) -> HttpResponse | None:
    """An answer for who asks too often: racers by their number, guests by address. ``rates``: as those of allauth, by
    action."""
    try:
        key = str(request.user.pk) if request.user.is_authenticated else ratelimit.get_ip(request)
    except PermissionDenied:
        key = ""
    if ratelimit.consume(request, app="races", action=action, config=rates, key=key, limit_get=True) is not None:
        return None
    response = HttpResponse(status=429)
    response["Retry-After"] = "60"
    return response
