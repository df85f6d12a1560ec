"""Pages of races of real cars: timing, laps and the organiser's setup."""

import hashlib
from collections.abc import Callable
from functools import wraps
from typing import Any
from uuid import UUID

from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.templatetags.static import static
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.pages.faults import faults_reported
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races.entries.selectors.lists import entry_of
from races.entries.selectors.visibility import can_organise
from races.models import Guest, MeasuredLap, Race, TimingSensor
from races.models.race import LONGEST_LAP_MS
from races.timing import selectors
from races.timing import services as timing
from races.timing.forms import CorrectionForm
from races.timing.services.files import MOST_BYTES, FileRefused, lap_lines
from races.web.audit_log import log_if_admin

from ..web.race_page import race_context
from ..web.views import downloaded, organised_race, visible_race

SESSIONS_PER_PAGE = 30
# What the timekeeper's page is made of besides itself, so that it can be loaded again without a network.
_STYLES = (
    "css/base.css",
    "css/layout.css",
    "css/forms.css",
    "css/board.css",
    "css/pages.css",
    "races/race.css",
    "reports/report.css",
    "live/live.css",
    "css/narrow.css",
    "league/league.css",
    "timing/timing.css",
)
_SCRIPTS = (
    "paddock.js",
    "vendor/idiomorph.min.js",
    "live-page.js",
    "stream.js",
    "timing/store.js",
    "timing/timing.js",
    "mark.svg",
)
# Texts that the page's script shows; %s stands for a figure.
_WORDS = {
    "unsent": gettext_lazy("%s sessions have not been sent yet."),
    "allSent": gettext_lazy("All sent."),
    "offline": gettext_lazy("Offline. Keep timing: data is stored in this browser and sent later."),
    "loggedOut": gettext_lazy("You are logged out. Log in again in another tab, then send."),
    "refused": gettext_lazy("%s sessions were refused for the reasons below."),
    "bounce": gettext_lazy("%s s after the last: taken for the same crossing."),
    "tooLong": gettext_lazy("Longer than %s minutes: not counted. The next lap has started."),
    "clock": gettext_lazy("The clock of this device stood still or jumped by %s s. The lap is marked invalid."),
    "reloaded": gettext_lazy("Page reloaded: the current lap is measured by the wall clock."),
    "over": gettext_lazy("Time is up. The current lap still counts."),
    "elsewhere": gettext_lazy("This page is open in another tab. Times are taken there."),
    "notKept": gettext_lazy("This browser cannot store data, so a reload would lose laps. Use another browser."),
    "noReload": gettext_lazy("Without a network this page cannot be loaded again: do not close it."),
    "valid": gettext_lazy("valid"),
    "invalid": gettext_lazy("invalid"),
    "sent": gettext_lazy("sent"),
    "waiting": gettext_lazy("not sent"),
    "discard": gettext_lazy("Discard"),
    "discarded": gettext_lazy("discarded"),
    "sure": gettext_lazy("Discard this session with its laps?"),
    "laps": gettext_lazy("laps: %s"),
    "sensorIdle": gettext_lazy("The sensor begins the first lap."),
    "needsNetwork": gettext_lazy("The sensor is offline. Time by hand until it reconnects."),
    "who": gettext_lazy("Choose a racer, or write a guest's name."),
    "change": gettext_lazy("Change to the racer chosen above"),
    "running": gettext_lazy("in progress"),
}


def timed_race(request: HttpRequest, slug: str) -> Race:
    """The race, or 404 unless the reader may take times in it."""
    race = visible_race(request, slug)
    if not selectors.can_keep_time(request.user, race):
        raise Http404
    return race


@cache_control(private=True, no_cache=True)
@login_required
@require_safe
def race_timing(request: HttpRequest, slug: str) -> HttpResponse:
    """The timekeeper's page, with all data of its script, so that it works offline."""
    race = timed_race(request, slug)
    data = {
        "slug": race.slug,
        "session_ms": race.session_s * 1000,
        "minimum_lap_ms": race.minimum_lap_ms,
        "longest_lap_ms": LONGEST_LAP_MS,
        "penalty_ms": race.off_track_penalty_ms,
        "api": f"/api/v1/races/{race.slug}/",
        "worker": reverse("race_timing_worker", args=[race.slug]),
        "csrf": settings.CSRF_COOKIE_NAME,
        "racers": [
            {"racer": entry.racer.alias, "name": entry.shown_name, "model": entry.model.name if entry.model else None}
            for entry in selectors.timeable_entries(race).filter(guest_name="")
        ],
        "guests": [{"id": str(guest.pk), "name": guest.name} for guest in selectors.guests_of(race)],
        "sensors": [{"number": one.pk, "name": one.name} for one in selectors.sensors_of(race).filter(revoked_at=None)],
        "words": {name: str(text) for name, text in _WORDS.items()},
    }
    context = {"race": race, "data": data, "can_organise": can_organise(request.user, race)}
    return render(request, "races/timing/page.html", context)


@cache_control(private=True, no_cache=True)
@login_required
@require_safe
def race_timing_worker(request: HttpRequest, slug: str) -> HttpResponse:
    """The script that keeps the timekeeper's page in the browser, and nothing else of the site."""
    race = timed_race(request, slug)
    files = [static(name) for name in (*_STYLES, *_SCRIPTS)]
    page = reverse("race_timing", args=[race.slug])
    mark = hashlib.sha256(repr([page, files]).encode()).hexdigest()[:12]
    context = {"files": files, "page": page, "name": f"timing-{race.pk}", "mark": mark}
    return render(request, "races/timing/worker.js", context, content_type="text/javascript; charset=utf-8")


@require_safe
def race_laps(request: HttpRequest, slug: str) -> HttpResponse:
    """Every lap that was timed, with its penalties, corrections and their reasons."""
    race = _physical(visible_race(request, slug))
    sessions = selectors.sessions_of(race)
    if alias := request.GET.get("racer", ""):
        sessions = sessions.filter(entry__racer__alias__iexact=alias)
    page = Paginator(sessions, SESSIONS_PER_PAGE).get_page(request.GET.get("page"))
    context = race_context(request, race) | {"tab": "laps", "page": page}
    return render(request, "races/timing/laps.html", context)


@require_safe
def race_laps_csv(request: HttpRequest, slug: str) -> HttpResponse:
    """The same as CSV, which may be taken in again."""
    race = _physical(visible_race(request, slug))
    return downloaded("".join(lap_lines(race)), f"{race.slug}-laps.csv", "text/csv; charset=utf-8")


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def lap_correct(request: HttpRequest, slug: str, id: UUID) -> HttpResponse:
    """Put a lap right, with a reason."""
    race = _physical(organised_race(request, slug))
    laps = MeasuredLap.objects.select_related("session__entry__racer", "session__race").filter(session__race=race)
    lap = get_object_or_404(laps, pk=id)
    form = CorrectionForm(request.POST or None, lap=lap)
    if request.method == "POST" and form.is_valid():
        by = racer_of(request)
        try:
            timing.correct_lap(lap=lap, by=by, now=timezone.now(), **form.changes())
        except UserFault as fault:
            form.show(fault)
        else:
            log_if_admin(by, lap.session.entry, f"Corrected a lap: {form.cleaned_data['reason']}")
            messages.success(request, _("Lap corrected."))
            return redirect("race_laps", race.slug)
    context = {"race": race, "lap": lap, "form": form}
    return render(request, "races/timing/correct.html", context, status=422 if form.errors else 200)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_timing_setup(request: HttpRequest, slug: str) -> HttpResponse:
    """Timekeepers, sensors, guests and files, for the race's organiser; a POST creates a sensor or imports a file."""
    race = _physical(organised_race(request, slug))
    if request.method == "POST":
        return _take_file(request, race) if request.POST.get("do") == "file" else _make_sensor(request, race)
    return _setup(request, race)


def _set_up(action: Callable[..., str]) -> Callable[..., HttpResponse]:
    """A POST by the organiser of a race of real cars; the set-up page shows the returned message or the refusal."""

    @login_required
    @require_POST
    @wraps(action)
    def view(request: HttpRequest, slug: str, **named: Any) -> HttpResponse:
        race = _physical(organised_race(request, slug))
        with faults_reported(request):
            messages.success(request, action(request, race, **named))
        return redirect("race_timing_setup", race.slug)

    return view


@_set_up
def timekeeper_name(request: HttpRequest, race: Race) -> str:
    """Name a timekeeper."""
    alias = request.POST.get("racer", "")
    named = timing.name_timekeeper(race=race, alias=alias, by=racer_of(request), now=timezone.now())
    return _("%(racer)s is now a timekeeper.") % {"racer": named.racer.alias}


@_set_up
def timekeeper_dismiss(request: HttpRequest, race: Race, alias: str) -> str:
    """Dismiss a timekeeper."""
    named = get_object_or_404(selectors.timekeepers_of(race), racer__alias=alias)
    timing.dismiss_timekeeper(race=race, racer=named.racer, by=racer_of(request))
    return _("%(racer)s is no longer a timekeeper.") % {"racer": alias}


@_set_up
def sensor_revoke(request: HttpRequest, race: Race, number: int) -> str:
    """Revoke a sensor's token."""
    sensor = get_object_or_404(TimingSensor, race=race, pk=number)
    timing.revoke_sensor(sensor=sensor, by=racer_of(request), now=timezone.now())
    return _("Token revoked.")


@_set_up
def guest_link(request: HttpRequest, race: Race, id: UUID) -> str:
    """Give a guest's laps to a racer."""
    guest = get_object_or_404(Guest.objects.select_related("race", "entry"), race=race, pk=id)
    alias = request.POST.get("racer", "").strip()
    racer = Racer.objects.filter(alias__iexact=alias).first()
    if racer is None:
        raise UserFault("timekeeper_unknown", racer=alias[:64])
    timing.link_guest(guest=guest, racer=racer, by=racer_of(request), now=timezone.now())
    return _("The laps of %(guest)s now belong to %(racer)s.") % {"guest": guest.name, "racer": racer.alias}


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def guest_claim(request: HttpRequest, claim: str) -> HttpResponse:
    """Take over the laps of a guest."""
    guest = get_object_or_404(Guest.objects.select_related("race", "entry"), claim=claim, linked_at=None)
    if request.method == "POST":
        with faults_reported(request):
            timing.claim_guest(claim=claim, racer=racer_of(request), now=timezone.now())
            messages.success(request, _("You have taken over these laps."))
            return redirect(guest.race)
    context = {"guest": guest, "race": guest.race, "sessions": selectors.sessions_of(guest.race, guest.entry)}
    return render(request, "races/timing/claim.html", context)


@login_required
@require_POST
def car_choose(request: HttpRequest, slug: str) -> HttpResponse:
    """Say which of my models drives my real car in this race."""
    race = _physical(visible_race(request, slug))
    entry = entry_of(race, request.user)
    if entry is None or entry.is_withdrawn:
        raise Http404
    chosen = request.POST.get("model", "")
    model = get_object_or_404(models_of(request.user), public_id=chosen) if chosen else None
    with faults_reported(request):
        timing.choose_car(entry=entry, model=model, now=timezone.now())
        messages.success(request, _("Saved."))
    return redirect(race)


def _physical(race: Race) -> Race:
    if not race.physical:
        raise Http404
    return race


def _setup(request: HttpRequest, race: Race, *, status: int = 200, **more: Any) -> HttpResponse:
    context = {
        "race": race,
        "timekeepers": selectors.timekeepers_of(race),
        "sensors": selectors.sensors_of(race),
        "guests": [
            (one, request.build_absolute_uri(reverse("guest_claim", args=[one.claim])))
            for one in selectors.guests_of(race)
        ],
        "crossings_url": request.build_absolute_uri("/api/v1/timing/crossings/"),
        **more,
    }
    response = render(request, "races/timing/setup.html", context, status=status)
    response["Cache-Control"] = "private, no-store"  # a token may stand in it
    return response


def _make_sensor(request: HttpRequest, race: Race) -> HttpResponse:
    """Make a sensor and show its token, this once."""
    name = request.POST.get("name", "")
    with faults_reported(request):
        sensor, text = timing.make_sensor(race=race, name=name, by=racer_of(request), now=timezone.now())
        return _setup(request, race, token=text, sensor=sensor)
    return redirect("race_timing_setup", race.slug)


def _take_file(request: HttpRequest, race: Race) -> HttpResponse:
    """Take laps from a file."""
    file = request.FILES.get("file")
    text = "" if file is None else file.read(MOST_BYTES + 1).decode("utf-8-sig", "replace")
    with faults_reported(request):
        try:
            count = timing.take_file(race=race, by=racer_of(request), text=text, now=timezone.now())
        except FileRefused as fault:
            return _setup(request, race, file_fault=fault, status=422)
        imported = ngettext("%(count)s lap imported.", "%(count)s laps imported.", count)
        messages.success(request, imported % {"count": count})
    return redirect("race_timing_setup", race.slug)
