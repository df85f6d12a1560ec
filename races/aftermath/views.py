"""Pages and downloads after a race: replay, highlights, CSV, PDF and certificates."""

from collections.abc import Callable, Iterable

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.csrf import ensure_csrf_cookie
from django.views.decorators.http import require_POST, require_safe

from accounts.request_racer import racer_of
from core.pages.faults import faults_reported, report_fault
from paddock.errors import PaddockError, UserFault
from races.aftermath.api import RATES
from races.aftermath.certificate import certificate, entry_of_certificate, placed, require_settled
from races.aftermath.highlights import ask_for_highlights
from races.aftermath.results import event_csv, laps_csv, results_pdf
from races.aftermath.watch_again import again_document
from races.live.selectors.events import live_events_visible_to
from races.models import LiveEvent, LiveState, Race
from videos.responses import page_language

from ..web.views import downloaded, too_many, visible_race


@require_safe
def race_results_pdf(request: HttpRequest, slug: str) -> HttpResponse:
    """The results of a race that is over as PDF: of its live event if it had one."""
    race = visible_race(request, slug)
    return _paper(request, race, f"{race.slug}-results.pdf", lambda address: results_pdf(race, timezone.now(), address))


@require_safe
def race_certificate(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    race = visible_race(request, slug)
    entry = entry_of_certificate(race, alias)
    return _paper(
        request,
        race,
        f"{race.slug}-{entry.racer.alias}.pdf",
        lambda address: certificate(placed(race, entry, timezone.now()), address),
    )


@require_safe
def live_results_csv(request: HttpRequest, slug: str) -> HttpResponse:
    return _lines(request, slug, "results", event_csv)


@require_safe
def live_laps_csv(request: HttpRequest, slug: str) -> HttpResponse:
    return _lines(request, slug, "laps", laps_csv)


@require_safe
@ensure_csrf_cookie
def live_again(request: HttpRequest, slug: str) -> HttpResponse:
    """The replay of the show, from its first run to the podium, without spoilers."""
    race, event = _event(request, slug)
    if event.state != LiveState.ENDED:
        return redirect("live_event", slug)
    context = {"race": race, "event": event, "phase": "running"}
    return _private(render(request, "races/aftermath/watch_again.html", context))


@require_safe
def live_again_data(request: HttpRequest, slug: str) -> HttpResponse:
    """What its page plays: every step with how the event stood. 404 before the end."""
    _race, event = _event(request, slug)
    try:
        return JsonResponse(again_document(event, timezone.now()))
    except UserFault as fault:
        raise Http404 from fault


@login_required
@require_POST
def live_highlights(request: HttpRequest, slug: str) -> HttpResponse:
    _race, event = _event(request, slug)
    try:
        ask_for_highlights(event=event, by=racer_of(request), language=page_language(), now=timezone.now())
    except PaddockError as fault:
        report_fault(request, fault)
    return redirect(f"{reverse('live_event', args=[slug])}#highlights")


def _event(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent]:
    race = visible_race(request, slug)
    return race, get_object_or_404(live_events_visible_to(request.user), race=race)


def _lines(request: HttpRequest, slug: str, what: str, lines: Callable[[LiveEvent], Iterable[str]]) -> HttpResponse:
    race, event = _event(request, slug)
    with faults_reported(request):
        require_settled(race, timezone.now())
        return _private(downloaded("".join(lines(event)), f"{race.slug}-{what}.csv", "text/csv; charset=utf-8"))
    return redirect("live_event", slug)


def _paper(request: HttpRequest, race: Race, name: str, make: Callable[[str], bytes]) -> HttpResponse:
    """``make``: the PDF, given the address of the race's page."""
    with faults_reported(request):
        require_settled(race, timezone.now())
        if request.method == "HEAD":
            return _private(downloaded(b"", name, "application/pdf"))
        if (late := too_many(request, "paper", RATES)) is not None:
            return late
        pdf = make(request.build_absolute_uri(race.get_absolute_url()))
        return _private(downloaded(pdf, name, "application/pdf"))
    return redirect(race)


def _private(response: HttpResponse) -> HttpResponse:
    response["Cache-Control"] = "private, no-store"
    return response
