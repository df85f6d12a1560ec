"""Pages of a live event: lobby and show for spectators, console for organisers."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import cache_control
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.request_racer import racer_of
from core.database.kept_queries import KeptQuery
from core.forms import ignored_fields, warn_of_ignored
from core.pages.faults import faults_reported
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races.duels.selectors import duels_of
from races.entries.selectors.lists import entry_of
from races.entries.terms import has_accepted
from races.live.actions import ACTS, act
from races.live.api import after_in, poses_document, slot_in
from races.live.document import shared_document
from races.live.forms import LiveForm, SpeedForm, modes
from races.live.selectors import events
from races.live.selectors.speed import live_racers_commanded_by, speed_document
from races.live.services import change_live, check_in, choose_model, command_now, command_start, name_deputy, plan_live
from races.live.services.roll_call import LACKS_CAR
from races.live.services.sealing import AHEAD
from races.live.statistics import figure_words, figures_of
from races.live.streaming.camera import frames_of
from races.models import Entry, LiveEvent, LiveRacer, LiveState, Opponents, Visibility
from races.models.live import TO_COME, UNDER_WAY
from races.models.sensors import not_offered
from races.replays.document import look_document

from ...web.views import organised_race, watched_race
from .screens import panel_context

LOG_SHOWN = 30
never_stored = cache_control(private=True, no_store=True)
FRAMES_KEPT_S = 600


@require_safe
def live_event(request: HttpRequest, slug: str) -> HttpResponse:
    """The lobby before it begins, then the show, then how it ended."""
    return render(request, "races/live/event.html", _shown(request, _watched(request, slug)))


@never_stored
@require_safe
def live_state(request: HttpRequest, slug: str) -> JsonResponse:
    """The event as data, for the page to renew itself."""
    return JsonResponse(shared_document(_watched(request, slug), timezone.now()))


@never_stored
@require_safe
def live_poses(request: HttpRequest, slug: str) -> JsonResponse:
    """What of a run has been played by now: ``slot``, ``after`` which chunk."""
    slot = slot_in(_watched(request, slug), request.GET.get("slot", ""))
    return JsonResponse(poses_document(slot, after_in(request.GET.get("after", ""))))


@require_safe
def live_frames(request: HttpRequest, slug: str) -> HttpResponse:
    """What the cars of a run saw in a chunk of it that has been played: ``slot``, ``n``. 404 before, 204 while the
    machine has too much else to draw."""
    event = _watched(request, slug)
    slot, number = slot_in(event, request.GET.get("slot", "")), _number(request.GET.get("n", ""))
    strip = None if number is None else frames_of(slot, timezone.now(), number)
    if strip is None:
        raise Http404
    response = HttpResponse(strip, content_type="image/png") if strip else HttpResponse(status=204)
    # what has passed stays as it was, for everybody who may see it
    kept = "public" if event.race.visibility == Visibility.PUBLIC else "private"
    response["Cache-Control"] = f"{kept}, max-age={FRAMES_KEPT_S}" if strip else "private, no-store"
    return response


@never_stored
@require_safe
def live_ghost(request: HttpRequest, slug: str) -> JsonResponse:
    """A shown run as a ghost: of ``slot``, or one ``lap`` of it."""
    event = _watched(request, slug)
    lap = _number(request.GET.get("lap", "")) if "lap" in request.GET else None
    slot = slot_in(event, request.GET.get("slot", ""))
    columns = events.shown_line(slot, timezone.now(), lap)
    if columns is None or slot.shown_run is None or ("lap" in request.GET and lap is None):
        raise Http404
    return JsonResponse({"columns": columns, "look": look_document(slot.shown_run.model.look)})


@login_required
@require_POST
def live_mine(request: HttpRequest, slug: str) -> HttpResponse:
    """A racer chooses a model or checks in."""
    event = _event(request, slug)
    racer, now = racer_of(request), timezone.now()
    with faults_reported(request):
        if "here" in request.POST:
            check_in(event=event, racer=racer, now=now)
            messages.success(request, _("You are here."))
        else:
            model = get_object_or_404(models_of(racer), public_id=request.POST.get("model", ""))
            choose_model(event=event, racer=racer, model=model, now=now)
            messages.success(request, _("You drive with %(model)s.") % {"model": model.name})
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


@never_stored
@login_required
@require_safe
def live_console(request: HttpRequest, slug: str) -> HttpResponse:
    """What the organisers of an event see of it and do in it."""
    event = _run_by(request, slug)
    race = event.race
    now = timezone.now()
    rows = events.console_rows(event, now)
    slots = [row.slot for row in rows]
    in_order = {slot.racer_id for slot in slots if slot.state != "removed"}
    entered = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False).select_related("racer")
    here = {racer.entry_id: racer for racer in events.live_racers(event)}
    context = {
        "race": race,
        "event": event,
        "now": now,
        "phase": events.phase_of(event, now),
        "rows": rows,
        "waits": _waits(event, rows),
        **panel_context(request, race, event),
        "current": next((row for row in rows if row.phase in ("countdown", "on_track")), None),
        "next": next(iter(events.up_next(event, slots)), None),
        "standings": events.live_standings(event),
        "roll": [(entry, here.get(entry.pk)) for entry in entered.order_by("entered_at", "pk")],
        "late": [
            entry
            for entry in entered.order_by("racer__alias")
            if entry.pk not in here or here[entry.pk].pk not in in_order
        ],
        "log": list(event.log.select_related("by").order_by("-pk")[:LOG_SHOWN]),
    }
    return render(request, "races/live/console.html", context)


@login_required
@require_POST
def live_act(request: HttpRequest, slug: str) -> HttpResponse:
    """Something that an organiser does, by the buttons of the console."""
    event = _run_by(request, slug)
    action = request.POST.get("action", "")
    if action not in ACTS:
        raise Http404
    with faults_reported(request):
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
    return redirect("live_console", slug)


def _waits(event: LiveEvent, rows: list[events.SlotRow]) -> bool:
    """Whether the console changes soon without a public event: by a computed run or a countdown."""
    coming = [row for row in rows if row.slot.state in TO_COME and row.slot.reason_code not in LACKS_CAR]
    is_computed = all(row.sealed == "sealed" for row in coming[:AHEAD])
    return event.state in UNDER_WAY and (not is_computed or any(row.phase == "countdown" for row in rows))


def _watched(request: HttpRequest, slug: str) -> LiveEvent:
    """The live event of a race that the reader may watch, or 404."""
    found = _events_of(race=watched_race(request, slug).pk)
    if not found:
        raise Http404
    return found[0]


_events_of = KeptQuery(lambda race: LiveEvent.objects.filter(race_id=race).select_related(*events.LIVE_RELATED))


def _event(request: HttpRequest, slug: str) -> LiveEvent:
    """The live event of a race that the reader may see, or 404."""
    return get_object_or_404(events.live_events_visible_to(request.user), race__slug=slug)


def _run_by(request: HttpRequest, slug: str) -> LiveEvent:
    """The same, or 404 unless the reader may run it."""
    event = _event(request, slug)
    if not events.can_run_live(request.user, event):
        raise Http404
    return event


def _shown(request: HttpRequest, event: LiveEvent) -> dict[str, object]:
    race = event.race
    now = timezone.now()
    rows = events.shared_rows(event)
    entry = entry_of(race, request.user)
    mine = None if entry is None else LiveRacer.objects.filter(event=event, entry=entry).select_related("model").first()
    document = shared_document(event, now)
    current = document["current"]
    figures = figures_of(event) if event.state == LiveState.ENDED else None
    garage = list(models_of(request.user)) if entry is not None and not entry.is_withdrawn else []
    return {
        "race": race,
        "event": event,
        "phase": events.phase_of(event, now),
        "document": document,
        "current": events.on_track(rows.order),
        "next": events.up_next(event, rows.order),
        "commanded": [car for car in (current["cars"] if current else ()) if car["speed"] is not None],
        "standings": rows.standings,
        "figures": figures,
        "figure_words": [] if figures is None else figure_words(figures),
        "duels": duels_of(race, request.user) if race.opponents == Opponents.MODELS else None,
        "roll": rows.racers,
        "entry": entry,
        "mine": mine,
        "models": [model for model in garage if not not_offered(model.sensors, race.sensors)],
        "asks_terms": not has_accepted(entry, race),
        "can_run": events.can_run_live(request.user, event),
        "is_spectator": not events.can_see_live(request.user, event),
    }


def _number(written: str) -> int | None:
    return int(written) if written.isdecimal() and len(written) < 12 else None


@never_stored
@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def live_speed(request: HttpRequest, slug: str) -> HttpResponse:
    """The car's past and coming speed commands; ``?racer=`` selects the car of a deputy's racer."""
    event = _event(request, slug)
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
        "race": event.race,
        "event": event,
        "form": form,
        "document": speed_document(event, mine, now),
        "modes": modes(),
        "presets": ("0.5", "0.8", "1", "1.2", "1.5"),
        "own": mine.entry.racer_id == racer_of(request).pk,
    }
    return render(request, "races/live/speed.html", context, status=status)


def _done(request: HttpRequest, event: LiveEvent, mine: LiveRacer, form: SpeedForm) -> bool:
    by, now = racer_of(request), timezone.now()
    with faults_reported(request):
        if "deputy" in request.POST:
            name_deputy(event=event, racer=by, alias=request.POST["deputy"].strip(), now=now)
            messages.success(request, _("Saved."))
            return True
        if not form.is_valid():
            return False
        chosen = form.cleaned_data
        command = command_now if chosen["when"] == "now" else command_start
        command(event=event, racer=mine, by=by, mode=chosen["mode"], value=chosen["value"] or 0.0, now=now)
        if command is command_start:
            messages.success(request, _("Start speed of your next runs saved."))
    return True


def _commanded(event: LiveEvent, request: HttpRequest) -> LiveRacer:
    """The racer whose car the reader commands. Raises Http404 for all others, and where there is no speed control."""
    if not event.speed_control:
        raise Http404
    alias = request.GET.get("racer", "") or racer_of(request).alias
    return get_object_or_404(live_racers_commanded_by(request.user), event=event, entry__racer__alias__iexact=alias)
