"""Races of real cars: the timekeeper's page, what was timed, and what the organiser sets up."""

from __future__ import annotations

import hashlib
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
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.who import racer_of
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races.audit import log_if_admin
from races.measured_files import lap_lines
from races.models import Guest, MeasuredLap, Race, TimingSensor
from races.models.race import LONGEST_LAP_MS
from races.selectors import can_organise, entry_of
from races.selectors.timing import can_keep_time, guests_of, sensors_of, sessions_of, timekeepers_of, who_may_be_timed
from races.services import timing
from races.services.timing.files import MOST_BYTES, FileRefused
from races.timing_forms import CorrectionForm

from .common import organised_race, tell_fault, visible_race
from .races import race_context

SESSIONS_PER_PAGE = 30
# What the timekeeper's page is made of besides itself, so that it can be loaded again without a network.
_STYLES = (
    "base",
    "layout",
    "forms",
    "board",
    "pages",
    "race",
    "report",
    "live",
    "screens",
    "narrow",
    "league",
    "timing",
)
_SCRIPTS = ("paddock.js", "moves.js", "stream.js", "timing-store.js", "timing.js", "mark.svg")
# What the page says that only its script knows when; %s stands for a figure.
_WORDS = {
    "unsent": gettext_lazy("%s sessions have not been sent yet."),
    "allSent": gettext_lazy("All sent."),
    "offline": gettext_lazy("Offline. Keep timing: data is stored in this browser and sent later."),
    "loggedOut": gettext_lazy("You are logged out. Log in again in another tab, then send."),
    "refused": gettext_lazy("%s sessions were refused. Their reasons stand below."),
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
    if not can_keep_time(request.user, race):
        raise Http404
    return race


@login_required
@require_safe
def race_timing(request: HttpRequest, slug: str) -> HttpResponse:
    """Where times are taken. Everything that the script needs stands in the page, so that it goes on without a
    network."""
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
            for entry in who_may_be_timed(race).filter(guest_name="")
        ],
        "guests": [{"id": str(guest.pk), "name": guest.name} for guest in guests_of(race)],
        "sensors": [{"number": one.pk, "name": one.name} for one in sensors_of(race).filter(revoked_at=None)],
        "words": {name: str(text) for name, text in _WORDS.items()},
    }
    context = {"race": race, "data": data, "can_organise": can_organise(request.user, race)}
    response = render(request, "races/timing/page.html", context)
    response["Cache-Control"] = "private, no-cache"
    return response


@login_required
@require_safe
def race_timing_worker(request: HttpRequest, slug: str) -> HttpResponse:
    """The script that keeps the timekeeper's page in the browser, and nothing else of the site."""
    race = timed_race(request, slug)
    files = [static(f"css/{name}.css") for name in _STYLES] + [static(name) for name in _SCRIPTS]
    page = reverse("race_timing", args=[race.slug])
    mark = hashlib.sha256(repr([page, files]).encode()).hexdigest()[:12]
    context = {"files": files, "page": page, "name": f"timing-{race.pk}", "mark": mark}
    script = render(request, "races/timing/worker.js", context, content_type="text/javascript; charset=utf-8")
    script["Cache-Control"] = "private, no-cache"
    return script


@require_safe
def race_laps(request: HttpRequest, slug: str) -> HttpResponse:
    """Every lap that was timed, with its penalties, corrections and their reasons."""
    race = _physical(visible_race(request, slug))
    sessions = sessions_of(race)
    if alias := request.GET.get("racer", ""):
        sessions = sessions.filter(entry__racer__alias__iexact=alias)
    page = Paginator(sessions, SESSIONS_PER_PAGE).get_page(request.GET.get("page"))
    context = race_context(request, race) | {"tab": "laps", "page": page}
    return render(request, "races/timing/laps.html", context)


@require_safe
def race_laps_csv(request: HttpRequest, slug: str) -> HttpResponse:
    """The same as CSV, which may be taken in again."""
    race = _physical(visible_race(request, slug))
    response = HttpResponse("".join(lap_lines(race)), content_type="text/csv; charset=utf-8")
    response["Content-Disposition"] = f'attachment; filename="{race.slug}-laps.csv"'
    return response


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
    """Timekeepers, sensors, guests and files, for who organises the race; a POST makes a sensor, or takes a file."""
    race = _physical(organised_race(request, slug))
    if request.method == "POST":
        return _take_file(request, race) if request.POST.get("do") == "file" else _make_sensor(request, race)
    return _setup(request, race)


@login_required
@require_POST
def timekeeper_name(request: HttpRequest, slug: str) -> HttpResponse:
    """Name a timekeeper."""
    race = _physical(organised_race(request, slug))
    try:
        named = timing.name_timekeeper(
            race=race, alias=request.POST.get("racer", ""), by=racer_of(request), now=timezone.now()
        )
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        messages.success(request, _("%(racer)s may take times now.") % {"racer": named.racer.alias})
    return redirect("race_timing_setup", race.slug)


@login_required
@require_POST
def timekeeper_dismiss(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """Dismiss one."""
    race = _physical(organised_race(request, slug))
    named = get_object_or_404(timekeepers_of(race), racer__alias=alias)
    timing.dismiss_timekeeper(race=race, racer=named.racer, by=racer_of(request))
    messages.success(request, _("%(racer)s is no longer a timekeeper.") % {"racer": alias})
    return redirect("race_timing_setup", race.slug)


@login_required
@require_POST
def sensor_revoke(request: HttpRequest, slug: str, number: int) -> HttpResponse:
    """Revoke a sensor's token."""
    race = _physical(organised_race(request, slug))
    sensor = get_object_or_404(TimingSensor, race=race, pk=number)
    timing.revoke_sensor(sensor=sensor, by=racer_of(request), now=timezone.now())
    messages.success(request, _("Token revoked."))
    return redirect("race_timing_setup", race.slug)


@login_required
@require_POST
def guest_link(request: HttpRequest, slug: str, id: UUID) -> HttpResponse:
    """Give a guest's laps to a racer."""
    race = _physical(organised_race(request, slug))
    guest = get_object_or_404(Guest.objects.select_related("race", "entry"), race=race, pk=id)
    alias = request.POST.get("racer", "").strip()
    try:
        racer = Racer.objects.filter(alias__iexact=alias).first()
        if racer is None:
            raise UserFault("timekeeper_unknown", racer=alias[:64])
        timing.link_guest(guest=guest, racer=racer, by=racer_of(request), now=timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        said = {"guest": guest.name, "racer": racer.alias}
        messages.success(request, _("The laps of %(guest)s are those of %(racer)s now.") % said)
    return redirect("race_timing_setup", race.slug)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def guest_claim(request: HttpRequest, claim: str) -> HttpResponse:
    """Take over what was timed for me as a guest."""
    guest = get_object_or_404(Guest.objects.select_related("race", "entry"), claim=claim, linked_at=None)
    if request.method == "POST":
        try:
            timing.claim_guest(claim=claim, racer=racer_of(request), now=timezone.now())
        except UserFault as fault:
            tell_fault(request, fault)
        else:
            messages.success(request, _("You have taken over these laps."))
            return redirect(guest.race)
    context = {"guest": guest, "race": guest.race, "sessions": sessions_of(guest.race, guest.entry)}
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
    try:
        timing.choose_car(entry=entry, model=model, now=timezone.now())
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        messages.success(request, _("Saved."))
    return redirect(race)


def _physical(race: Race) -> Race:
    if not race.physical:
        raise Http404
    return race


def _claim_address(request: HttpRequest, guest: Guest) -> str:
    return request.build_absolute_uri(reverse("guest_claim", args=[guest.claim]))


def _setup(request: HttpRequest, race: Race, *, status: int = 200, **more: Any) -> HttpResponse:
    context = {
        "race": race,
        "timekeepers": timekeepers_of(race),
        "sensors": sensors_of(race),
        "guests": [
            (one, request.build_absolute_uri(reverse("guest_claim", args=[one.claim]))) for one in guests_of(race)
        ],
        "crossings_url": request.build_absolute_uri("/api/v1/timing/crossings/"),
        **more,
    }
    response = render(request, "races/timing/setup.html", context, status=status)
    response["Cache-Control"] = "private, no-store"  # a token may stand in it
    return response


def _make_sensor(request: HttpRequest, race: Race) -> HttpResponse:
    """Make a sensor and show its token, this once."""
    try:
        sensor, text = timing.make_sensor(
            race=race, name=request.POST.get("name", ""), by=racer_of(request), now=timezone.now()
        )
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect("race_timing_setup", race.slug)
    return _setup(request, race, token=text, sensor=sensor)


def _take_file(request: HttpRequest, race: Race) -> HttpResponse:
    """Take laps from a file."""
    file = request.FILES.get("file")
    try:
        text = "" if file is None else file.read(MOST_BYTES + 1).decode("utf-8-sig", "replace")
        count = timing.take_file(race=race, by=racer_of(request), text=text, now=timezone.now())
    except FileRefused as fault:
        return _setup(request, race, file_fault=fault, status=422)
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        imported = ngettext("%(count)s lap imported.", "%(count)s laps imported.", count)
        messages.success(request, imported % {"count": count})
    return redirect("race_timing_setup", race.slug)
