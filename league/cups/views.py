"""Pages of the cup of the day."""

from datetime import date

from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, QueryDict
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from accounts.request_racer import racer_of
from core.pages.faults import faults_reported
from core.pages.pager import LeanPaginator
from core.streams.shared_pieces import shared_piece, shared_value
from evaluation.selectors import models_of
from league.cups import selectors
from league.cups.services import start_always, start_no_more
from league.models import Cup
from races.pages.views.races import page_number

PER_PAGE = 30


@require_safe
def cups(request: HttpRequest) -> HttpResponse:
    """The next cup, the car that starts automatically, the most successful racers, and all past cups."""
    number = page_number(request)

    def values() -> dict[str, object]:
        now = timezone.now()
        page = LeanPaginator(selectors.cups_over(), PER_PAGE).get_page(number)
        coming = selectors.cup_now(now)
        return {
            "cup": coming,
            "stage": None if coming is None else selectors.stage_of(coming, now),
            "time": settings.CUP_TIME,
            "zone": settings.TIME_ZONE,
            "page": page,
            "winners": selectors.winners_of_cups(list(page)),
            "query": QueryDict(),
        }

    context = {
        "cups": shared_piece("league/cups/parts/cups.html", values, key=number),
        "trophies": shared_piece(
            "league/cups/parts/trophies.html", lambda: {"trophies": selectors.most_trophies()}, key=()
        ),
        "starter": selectors.starter_of(request.user),
        "models": list(models_of(request.user)) if request.user.is_authenticated else [],
    }
    return render(request, "league/cups/list.html", context)


@require_safe
def cup(request: HttpRequest, day: str) -> HttpResponse:
    """One day's cup: qualifying, divisions, winners and what there is to tell."""

    def values() -> dict[str, object]:
        shown = cup_of(day)
        stage = selectors.stage_of(shown, timezone.now())
        return {
            "cup": shown,
            "stage": stage,
            "divisions": selectors.division_places(shown),
            "recap": selectors.recap_of(shown) if stage == "over" else None,
        }

    found = shared_value(("cup", day), lambda: cup_of(day))
    piece = shared_piece("league/cups/parts/cup.html", values, key=day)
    return render(request, "league/cups/cup.html", {"cup": found, "shown": piece})


@login_required
@require_POST
def cup_starter(request: HttpRequest) -> HttpResponse:
    racer = racer_of(request)
    public_id = request.POST.get("model", "")
    if not public_id:
        start_no_more(racer=racer)
        messages.success(request, _("Automatic entry is off."))
        return redirect("cups")
    model = get_object_or_404(models_of(racer), public_id=public_id)
    with faults_reported(request):
        start_always(racer=racer, model=model, now=timezone.now())
        messages.success(request, _("%(model)s starts in every cup from now on.") % {"model": model.name})
    return redirect("cups")


def cup_of(day: str) -> Cup:
    """The cup of a day such as 2026-11-26. Raises Http404."""
    try:
        wanted = date.fromisoformat(day)
    except ValueError:
        raise Http404 from None
    return get_object_or_404(selectors.cups_listed(), day=wanted)
