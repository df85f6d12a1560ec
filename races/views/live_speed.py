"""The page on which a racer, or their deputy, commands a car's speed in a live event."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods

from accounts.who import racer_of
from paddock.errors import UserFault
from races.models import LiveEvent, LiveRacer
from races.selectors.live import live_events_visible_to
from races.selectors.live_speed import live_racers_commanded_by, speed_document
from races.services.live import command_now, command_start, name_deputy
from races.speed_form import SpeedForm, modes

from .common import tell_fault, visible_race


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def live_speed(request: HttpRequest, slug: str) -> HttpResponse:
    """What is commanded and what comes; ``?racer=`` as the deputy of somebody."""
    race = visible_race(request, slug)
    event = get_object_or_404(live_events_visible_to(request.user), race=race)
    mine = _commanded(event, request)
    form = SpeedForm(request.POST if "when" in request.POST else None)
    status = 200
    if request.method == "POST":
        if _done(request, event, mine, form):
            query = f"?racer={mine.entry.racer.alias}" if "racer" in request.GET else ""
            return redirect(reverse("live_speed", args=[slug]) + query)
        status = 422
    now = timezone.now()
    context = {
        "race": race,
        "event": event,
        "form": form,
        "told": speed_document(event, mine, now),
        "modes": modes(),
        "presets": ("0.5", "0.8", "1", "1.2", "1.5"),
        "own": mine.entry.racer_id == racer_of(request).pk,
    }
    response = render(request, "races/live/speed.html", context, status=status)
    response["Cache-Control"] = "private, no-store"
    return response


def _done(request: HttpRequest, event: LiveEvent, mine: LiveRacer, form: SpeedForm) -> bool:
    by, now = racer_of(request), timezone.now()
    try:
        if "deputy" in request.POST:
            name_deputy(event=event, racer=by, alias=request.POST["deputy"].strip(), now=now)
            messages.success(request, _("Saved."))
            return True
        if not form.is_valid():
            return False
        asked = {"mode": form.cleaned_data["mode"], "value": form.cleaned_data["value"] or 0.0}
        if form.cleaned_data["when"] == "now":
            command_now(event=event, racer=mine, by=by, now=now, **asked)
        else:
            command_start(event=event, racer=mine, by=by, now=now, **asked)
            messages.success(request, _("Start speed of your next runs saved."))
    except UserFault as fault:
        tell_fault(request, fault)
    return True


def _commanded(event: LiveEvent, request: HttpRequest) -> LiveRacer:
    """The racer whose car the reader commands. Raises Http404 for all others, and where there is no speed control."""
    if not event.speed_control:
        raise Http404
    alias = request.GET.get("racer", "") or racer_of(request).alias
    return get_object_or_404(live_racers_commanded_by(request.user), event=event, entry__racer__alias__iexact=alias)
