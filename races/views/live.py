"""The live event of a race: its lobby and show for everybody, the console for its organisers."""

from __future__ import annotations

from typing import Any

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.who import racer_of
from core.forms import ignored_fields, warn_of_ignored
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races.afterwards.statistics import figures_of
from races.afterwards.words import figure_words
from races.api.live import after_in, poses_document, slot_in
from races.live_acts import ACTS, act
from races.live_document import live_document
from races.live_form import LiveForm
from races.live_seen import frames_of
from races.models import Entry, LiveEvent, LiveRacer, LiveState, Opponents, Race, Visibility
from races.models.live import TO_COME, UNDER_WAY
from races.replay import map_size
from races.selectors import entry_of
from races.selectors.duels import duels_of
from races.selectors.live import (
    SlotRow,
    can_run_live,
    can_see_live,
    console_rows,
    live_events_visible_to,
    live_racers,
    live_standings,
    on_track,
    phase_of,
    running_order,
    shown_line,
    up_next,
)
from races.selectors.terms import has_accepted
from races.sensors import not_offered
from races.services.live import change_live, choose_model, plan_live, say_here
from races.services.live.roll import LACKS_CAR
from races.services.live.sealing import AHEAD

from .common import organised_race, tell_fault, visible_race, watched_race
from .live_screens import panel_context

LOG_SHOWN = 30
FRAMES_KEPT_S = 600


@require_safe
def live_event(request: HttpRequest, slug: str) -> HttpResponse:
    """The lobby before it begins, then the show, then how it ended."""
    race, event = _watched(request, slug)
    return render(request, "races/live/event.html", _shown(request, race, event))


@require_safe
def live_state(request: HttpRequest, slug: str) -> JsonResponse:
    """The event as data, for the page to renew itself."""
    _race, event = _watched(request, slug)
    return _unkept(JsonResponse(live_document(event, timezone.now())))


@require_safe
def live_poses(request: HttpRequest, slug: str) -> JsonResponse:
    """What of a run has been played by now: ``slot``, ``after`` which chunk."""
    _race, event = _watched(request, slug)
    slot = slot_in(event, request.GET.get("slot", ""))
    return _unkept(JsonResponse(poses_document(slot, after_in(request.GET.get("after", "")))))


@require_safe
def live_frames(request: HttpRequest, slug: str) -> HttpResponse:
    """What the cars of a run saw in a chunk of it that has been played: ``slot``, ``n``. 404 before, 204 while the
    machine has too much else to draw."""
    race, event = _watched(request, slug)
    slot, number = slot_in(event, request.GET.get("slot", "")), _number(request.GET.get("n", ""))
    strip = None if number is None else frames_of(slot, timezone.now(), number)
    if strip is None:
        raise Http404
    response = HttpResponse(strip, content_type="image/png") if strip else HttpResponse(status=204)
    # what has passed stays as it was, for everybody who may see it
    kept = "public" if race.visibility == Visibility.PUBLIC else "private"
    response["Cache-Control"] = f"{kept}, max-age={FRAMES_KEPT_S}" if strip else "private, no-store"
    return response


@require_safe
def live_ghost(request: HttpRequest, slug: str) -> JsonResponse:
    """The line of a run that was shown, for others to be drawn beside: ``slot``, and which ``lap`` of it."""
    _race, event = _watched(request, slug)
    lap = _number(request.GET.get("lap", "")) if "lap" in request.GET else None
    line = shown_line(slot_in(event, request.GET.get("slot", "")), timezone.now(), lap)
    if line is None or ("lap" in request.GET and lap is None):
        raise Http404
    return _unkept(JsonResponse(line))


@login_required
@require_POST
def live_mine(request: HttpRequest, slug: str) -> HttpResponse:
    """A racer chooses their model, or says that they are here."""
    _race, event = _event(request, slug)
    racer, now = racer_of(request), timezone.now()
    try:
        if "here" in request.POST:
            say_here(event=event, racer=racer, now=now)
            messages.success(request, _("You are here."))
        else:
            model = get_object_or_404(models_of(racer), public_id=request.POST.get("model", ""))
            choose_model(event=event, racer=racer, model=model, now=now)
            messages.success(request, _("You drive with %(model)s.") % {"model": model.name})
    except UserFault as fault:
        tell_fault(request, fault)
    return redirect("live_event", slug)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def live_plan(request: HttpRequest, slug: str) -> HttpResponse:
    """Plan the live event of a race, or change its plan."""
    race = organised_race(request, slug)
    event = LiveEvent.objects.filter(race=race).exclude(state="cancelled").first()
    form = LiveForm(request.POST or None, event=event, now=timezone.now())
    if request.method == "POST" and form.is_valid():
        try:
            if event is None:
                plan_live(race=race, by=racer_of(request), now=timezone.now(), **form.plan())
            else:
                change_live(event=event, by=racer_of(request), seen=None, now=timezone.now(), **form.plan())
        except UserFault as fault:
            form.show(fault)
        else:
            messages.success(request, _("The live event is planned."))
            warn_of_ignored(request, ignored_fields(form))
            return redirect("live_console", slug)
    context = {"race": race, "event": event, "form": form}
    return render(request, "races/live/plan.html", context, status=422 if form.errors else 200)


@login_required
@require_safe
def live_console(request: HttpRequest, slug: str) -> HttpResponse:
    """What the organisers of an event see of it and do in it."""
    race, event = _run_by(request, slug)
    now = timezone.now()
    rows = console_rows(event, now)
    slots = [row.slot for row in rows]
    in_order = {slot.racer_id for slot in slots if slot.state != "removed"}
    entered = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False).select_related("racer")
    here = {racer.entry_id: racer for racer in live_racers(event)}
    context = {
        "race": race,
        "event": event,
        "now": now,
        "phase": phase_of(event, now),
        "rows": rows,
        "waits": _waits(event, rows),
        **panel_context(request, race, event),
        "current": next((row for row in rows if row.phase in ("countdown", "on_track")), None),
        "next": next(iter(up_next(event, slots)), None),
        "standings": live_standings(event),
        "roll": [(entry, here.get(entry.pk)) for entry in entered.order_by("entered_at", "pk")],
        "late": [
            entry
            for entry in entered.order_by("racer__alias")
            if entry.pk not in here or here[entry.pk].pk not in in_order
        ],
        "log": list(event.log.select_related("by").order_by("-pk")[:LOG_SHOWN]),
    }
    response = render(request, "races/live/console.html", context)
    response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_POST
def live_act(request: HttpRequest, slug: str) -> HttpResponse:
    """Something that an organiser does, by the buttons of the console."""
    _race, event = _run_by(request, slug)
    action = request.POST.get("action", "")
    if action not in ACTS:
        raise Http404
    try:
        act(
            event,
            action,
            by=racer_of(request),
            seen=_number(request.POST.get("version", "")),
            now=timezone.now(),
            slot=_number(request.POST.get("slot", "")),
            before=_number(request.POST.get("before", "")),
            racer=request.POST.get("racer", ""),
            message=request.POST.get("message", ""),
        )
    except UserFault as fault:
        tell_fault(request, fault)
    return redirect("live_console", slug)


def _waits(event: LiveEvent, rows: list[SlotRow]) -> bool:
    """Whether the console changes soon by what is told to nobody: a run that is being computed, a countdown."""
    coming = [row for row in rows if row.slot.state in TO_COME and row.slot.reason_code not in LACKS_CAR]
    is_computed = all(row.sealed == "sealed" for row in coming[:AHEAD])
    return event.state in UNDER_WAY and (not is_computed or any(row.phase == "countdown" for row in rows))


def _watched(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent]:
    """The race and its live event, or 404 when there is none or the reader may not watch it."""
    race = watched_race(request, slug)
    events = LiveEvent.objects.select_related("race__track", "race__organiser", "winner__racer")
    return race, get_object_or_404(events, race=race)


def _event(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent]:
    """The race and its live event, or 404 when there is none or the reader may not see it."""
    race = visible_race(request, slug)
    return race, get_object_or_404(live_events_visible_to(request.user), race=race)


def _run_by(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent]:
    """The same, or 404 unless the reader may run it."""
    race, event = _event(request, slug)
    if not can_run_live(request.user, event):
        raise Http404
    return race, event


def _shown(request: HttpRequest, race: Race, event: LiveEvent) -> dict[str, Any]:
    now = timezone.now()
    slots = running_order(event)
    entry = entry_of(race, request.user)
    mine = None if entry is None else LiveRacer.objects.filter(event=event, entry=entry).select_related("model").first()
    standings = live_standings(event)
    document = live_document(event, now)
    figures = figures_of(event) if event.state == LiveState.ENDED else None
    garage = list(models_of(request.user)) if request.user.is_authenticated else []
    return {
        "race": race,
        "event": event,
        "phase": phase_of(event, now),
        "document": document,
        "current": on_track(slots),
        "next": up_next(event, slots),
        "commanded": [car for car in (document["current"] or {}).get("cars", ()) if car["speed"] is not None],
        "standings": standings,
        "figures": figures,
        "figure_words": [] if figures is None else figure_words(figures),
        "duels": duels_of(race, request.user) if race.opponents == Opponents.MODELS else None,
        "roll": live_racers(event),
        "entry": entry,
        "mine": mine,
        "models": [model for model in garage if not not_offered(model.sensors, race.sensors)],
        "asks_terms": not has_accepted(entry, race),
        "map_size": map_size(race.track),
        "can_run": can_run_live(request.user, event),
        "is_spectator": not can_see_live(request.user, event),
    }


def _number(written: str) -> int | None:
    return int(written) if written.isdecimal() and len(written) < 12 else None


def _unkept(response: JsonResponse) -> JsonResponse:
    response["Cache-Control"] = "private, no-store"
    return response
