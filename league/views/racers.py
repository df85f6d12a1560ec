"""A racer as everybody sees them."""

from __future__ import annotations

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from accounts.following import can_follow, followers_shown, follows_visible_to
from accounts.who import racer_of
from evaluation.selectors import shared_models
from league.selectors.cups import trophies_of
from league.selectors.honours import honours_of
from league.selectors.racers import racer_shown, racing_since
from races.selectors import organised_by, racer_history
from races.selectors.rivalry import head_to_head, rivals_of

ORGANISED = 10
SHARED = 20


@require_safe
def racer(request: HttpRequest, alias: str) -> HttpResponse:
    """Alias, country, races and ranks."""
    shown = racer_shown(alias)
    if shown is None:
        raise Http404
    if shown.alias != alias:
        return redirect(shown, permanent=True)
    rival, now = None, timezone.now()
    is_other = request.user.is_authenticated and request.user.pk != shown.pk
    follows = is_other and follows_visible_to(request.user).filter(follower=request.user.pk, followed=shown).exists()
    if is_other and not shown.is_house:
        rival = head_to_head(racer_of(request), shown, request.user)
    history = racer_history(shown, request.user)
    context = {
        "racer": shown,
        "since": racing_since(shown),
        "history": history,
        "followers": followers_shown(request.user, shown),
        "follows": follows,
        "may_follow": is_other and not follows and can_follow(request.user, shown),
        "rivals": rivals_of(shown, request.user, now) if request.user == shown else (),
        "rival": rival if rival is not None and rival.met else None,
        "trophies": trophies_of(shown),
        "honours": honours_of(shown, request.user, now),
        "shared": list(shared_models(request.user).filter(owner=shown)[:SHARED]),
        "organised": list(organised_by(shown, request.user)[:ORGANISED]),
    }
    return render(request, "league/racer.html", context)
