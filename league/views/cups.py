"""Pages of the cup of the day."""

from __future__ import annotations

from datetime import date

from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from accounts.who import racer_of
from evaluation.selectors import models_of
from league.models import Cup
from league.selectors.cups import (
    cup_now,
    cups_listed,
    cups_over,
    division_places,
    most_trophies,
    recap_of,
    stage_of,
    starter_of,
    winners_of_cups,
)
from league.services.cups import start_always, start_no_more
from paddock.errors import UserFault
from races.selectors import entry_of
from races.views.common import tell_fault

PER_PAGE = 30


@require_safe
def cups(request: HttpRequest) -> HttpResponse:
    """The next cup, a car that starts by itself, who won most, and all cups that were."""
    now = timezone.now()
    page = Paginator(cups_over(), PER_PAGE).get_page(request.GET.get("page"))
    coming = cup_now(now)
    context = {
        "cup": coming,
        "stage": None if coming is None else stage_of(coming, now),
        "time": settings.CUP_TIME,
        "zone": settings.TIME_ZONE,
        "page": page,
        "winners": winners_of_cups(list(page)),
        "trophies": most_trophies(),
        "starter": starter_of(request.user),
        "models": list(models_of(request.user)) if request.user.is_authenticated else [],
    }
    return render(request, "league/cups.html", context)


@require_safe
def cup(request: HttpRequest, day: str) -> HttpResponse:
    """One day's cup: qualifying, divisions, winners and what there is to tell."""
    shown = cup_of(day)
    now = timezone.now()
    stage = stage_of(shown, now)
    context = {
        "cup": shown,
        "stage": stage,
        "divisions": division_places(shown),
        "recap": recap_of(shown) if stage == "over" else None,
        "entry": entry_of(shown.race, request.user),
        "starter": starter_of(request.user),
    }
    return render(request, "league/cup.html", context)


@login_required
@require_POST
def cup_starter(request: HttpRequest) -> HttpResponse:
    """Let a car start in every cup, or none."""
    racer = racer_of(request)
    public_id = request.POST.get("model", "")
    if not public_id:
        start_no_more(racer=racer)
        messages.success(request, _("Automatic entry is off."))
        return redirect("cups")
    model = get_object_or_404(models_of(racer), public_id=public_id)
    try:
        start_always(racer=racer, model=model, now=timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        messages.success(request, _("%(model)s starts in every cup from now on.") % {"model": model.name})
    return redirect("cups")


def cup_of(day: str) -> Cup:
    """The cup of a day such as 2026-11-26. Raises Http404."""
    try:
        wanted = date.fromisoformat(day)
    except ValueError:
        raise Http404 from None
    return get_object_or_404(cups_listed(), day=wanted)
