"""The public page of a racer."""

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.safestring import SafeString
from django.views.decorators.http import require_safe

from accounts.following import can_follow
from accounts.models import Racer
from accounts.profile.aliases import former_owner_of
from accounts.request_racer import racer_of
from core.streams.shared_pieces import shared_piece
from league.racers.selectors import profile_of, racer_shown, races_in_profile
from races.duels.rivalry import head_to_head, rivals_of


@require_safe
def racer(request: HttpRequest, alias: str) -> HttpResponse:
    is_mine = isinstance(request.user, Racer) and request.user.alias == alias and request.user.has_page
    shown = racer_of(request) if is_mine else racer_shown(alias, request.user)
    if shown is None:
        if (former := former_owner_of(alias)) is not None:
            return redirect(former)
        raise Http404
    if shown.alias != alias:
        return redirect(shown, permanent=True)
    rival, now = None, timezone.now()
    profile = profile_of(shown, request.user, now)

    def piece(name: str) -> SafeString:
        def values() -> dict[str, object]:
            return {"racer": shown, "profile": races_in_profile(shown, profile.private, timezone.now())}

        return shared_piece(f"league/racers/parts/{name}.html", values, key=(shown.pk, profile.private))

    is_other = request.user.is_authenticated and request.user.pk != shown.pk
    follows = is_other and getattr(shown, "is_followed", False)
    if is_other and not shown.is_house:
        rival = head_to_head(racer_of(request), shown, request.user)
    context = {
        "racer": shown,
        "profile": profile,
        "history": piece("history"),
        "results": piece("results"),
        "seasons": piece("seasons"),
        "follows": follows,
        "may_follow": is_other and not follows and can_follow(request.user, shown),
        "rivals": rivals_of(shown, request.user, now) if request.user == shown else (),
        "rival": rival if rival is not None and rival.met else None,
    }
    return render(request, "league/racers/racer.html", context)
