"""Results to keep: CSV and PDF of a race and of its live event, and certificates."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.csrf import ensure_csrf_cookie
from django.views.decorators.http import require_POST, require_safe

from accounts.who import racer_of
from paddock.errors import PaddockError, UserFault
from races.afterwards.again import again_document
from races.afterwards.certificate import certificate, placed, require_settled
from races.afterwards.highlights import ask_for_highlights
from races.afterwards.results import event_csv, laps_csv, results_pdf
from races.api.afterwards import RATES
from races.models import LiveEvent, LiveState, Race
from races.replay import map_size
from races.selectors.live import live_events_visible_to
from videos.responses import page_language

from .common import tell_fault, too_many, visible_race


@require_safe
def race_results_pdf(request: HttpRequest, slug: str) -> HttpResponse:
    """The results of a race that is over as PDF: of its live event if it had one."""
    race = visible_race(request, slug)
    address = request.build_absolute_uri(race.get_absolute_url())
    return _paper(request, race, f"{race.slug}-results.pdf", lambda: results_pdf(race, timezone.now(), address))


@require_safe
def race_certificate(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """A racer's certificate as PDF."""
    race = visible_race(request, slug)
    entries = race.entries.select_related("race__organiser", "race__track", "racer")
    entry = get_object_or_404(entries, racer__alias__iexact=alias, is_baseline=False, withdrawn_at=None)
    address = request.build_absolute_uri(race.get_absolute_url())

    def make() -> bytes:
        return certificate(placed(race, entry, timezone.now()), address)

    return _paper(request, race, f"{race.slug}-{entry.racer.alias}.pdf", make)


@require_safe
def live_results_csv(request: HttpRequest, slug: str) -> HttpResponse:
    """How a live event ended as CSV."""
    return _lines(request, slug, "results", event_csv)


@require_safe
def live_laps_csv(request: HttpRequest, slug: str) -> HttpResponse:
    """Every lap of a live event as CSV."""
    return _lines(request, slug, "laps", laps_csv)


@require_safe
@ensure_csrf_cookie
def live_again(request: HttpRequest, slug: str) -> HttpResponse:
    """The show once more, from its first run to the podium, by the page's own clock. It tells no result by itself."""
    race, event = _event(request, slug)
    if event.state != LiveState.ENDED:
        return redirect("live_event", slug)
    size = map_size(race.track) if race.track.has_shape else None
    response = render(
        request, "races/live/again.html", {"race": race, "event": event, "phase": "running", "map_size": size}
    )
    response["Cache-Control"] = "private, no-store"
    return response


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
    """Ask for a video of the event's highlights."""
    _race, event = _event(request, slug)
    try:
        ask_for_highlights(event=event, by=racer_of(request), language=page_language(), now=timezone.now())
    except PaddockError as fault:
        tell_fault(request, fault)
    return redirect(f"{reverse('live_event', args=[slug])}#highlights")


def _event(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent]:
    race = visible_race(request, slug)
    return race, get_object_or_404(live_events_visible_to(request.user), race=race)


def _lines(request: HttpRequest, slug: str, what: str, lines: Callable[[LiveEvent], Iterable[str]]) -> HttpResponse:
    race, event = _event(request, slug)
    try:
        require_settled(race, timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect("live_event", slug)
    response = HttpResponse("".join(lines(event)), content_type="text/csv; charset=utf-8")
    return _as_file(response, f"{race.slug}-{what}.csv")


def _paper(request: HttpRequest, race: Race, name: str, make: Callable[[], bytes]) -> HttpResponse:
    try:
        require_settled(race, timezone.now())
        if request.method == "HEAD":
            return _as_file(HttpResponse(content_type="application/pdf"), name)
        if (late := too_many(request, "paper", RATES)) is not None:
            return late
        return _as_file(HttpResponse(make(), content_type="application/pdf"), name)
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect(reverse("race", args=[race.slug]))


def _as_file(response: HttpResponse, name: str) -> HttpResponse:
    response["Content-Disposition"] = f'attachment; filename="{name}"'
    response["Cache-Control"] = "private, no-store"
    return response
