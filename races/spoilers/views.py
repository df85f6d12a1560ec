"""The switch that hides results until a race was watched, for racers and guests."""

from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.http import url_has_allowed_host_and_scheme
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import ensure_csrf_cookie
from django.views.decorators.http import require_http_methods

from accounts.request_racer import racer_of
from races.entries.selectors.visibility import races_visible_to
from races.models import Race
from races.spoilers.selectors import switch_of, write_switch
from races.spoilers.services import has_begun, hide_results, note_watched, show_results

from ..web.views import visible_race

SHOWN = 50


@never_cache
@ensure_csrf_cookie
@require_http_methods(["GET", "HEAD", "POST"])
def spoilers(request: HttpRequest) -> HttpResponse:
    """Turn the switch (``do`` hide or show), or have the results of one race shown from now on (``do=watched``,
    ``race``). Leads back to ``next``."""
    if request.method == "POST":
        return _change(request)
    switch = switch_of(request)
    mine = Race.objects.none() if not switch.on else _hidden(request)
    return render(request, "races/spoilers/switch.html", {"switch": switch, "races": list(mine[:SHOWN])})


def _hidden(request: HttpRequest) -> QuerySet[Race]:
    return races_visible_to(request.user).filter(pk__in=switch_of(request).hidden).order_by("-closes_at", "pk")


def _change(request: HttpRequest) -> HttpResponse:
    now, what = timezone.now(), request.POST.get("do", "")
    race = visible_race(request, request.POST.get("race", "")) if what == "watched" else None
    target = request.POST.get("next", "")
    if not url_has_allowed_host_and_scheme(target, {request.get_host()}, require_https=request.is_secure()):
        target = "/spoilers/" if race is None else race.get_absolute_url()
    response = HttpResponse(status=204) if request.headers.get("Accept") == "application/json" else redirect(target)
    if request.user.is_authenticated:
        racer = racer_of(request)
        if what == "hide":
            hide_results(racer=racer, now=now)
        elif what == "show":
            show_results(racer=racer)
        elif race is not None:
            note_watched(racer=racer, race=race, now=now)
        return response
    switch = switch_of(request)
    if what == "hide":
        write_switch(response, switch.since or now, switch.cookie.items())
    elif what == "show":
        write_switch(response, None)
    elif race is not None and switch.on:
        watched = {pk: live for pk, live in switch.cookie.items() if pk != race.pk}
        write_switch(response, switch.since, [*watched.items(), (race.pk, has_begun(race))])
    return response
