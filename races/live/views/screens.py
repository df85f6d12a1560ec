"""Screens of a live event: big screen, broadcast overlays, commentary and phone.

They show only the event's state, its poses and its revealed runs.
"""

from typing import Any
from urllib.parse import urlencode

import segno
from django.contrib.auth.decorators import login_required
from django.core.cache import cache
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone, translation
from django.utils.safestring import mark_safe
from django.utils.translation import gettext_lazy
from django.views.decorators.csrf import ensure_csrf_cookie
from django.views.decorators.http import require_POST, require_safe

from core.database.commit_cache import Unchanged, is_shared
from core.forms import explain
from core.pages.faults import report_fault
from core.rate_limits import address_of
from core.templatetags.site import THEMES, theme
from paddock.errors import UserFault
from races.duels.selectors import duels_of
from races.live.commentary import story_of
from races.live.document import podium_entries, shared_document
from races.live.selectors import events
from races.live.selectors.runs import facts_of, met_before
from races.live.services import react
from races.models import LiveEvent, LiveRacer, Opponents, Race, ReactionKind, Visibility
from races.web.spectator_links import keep_token, race_of_token, spectator_token

from ...web.views import organised_race, visible_race, watched_race

# Every screen with its label and its size in pixels: what the console lists, and what may report that it is connected.
SCREENS: dict[str, tuple[Any, tuple[int, int]]] = {
    "screen": (gettext_lazy("Big screen"), (1920, 1080)),
    "phone": (gettext_lazy("Phones of spectators"), (0, 0)),
    "overlay/tower": (gettext_lazy("Overlay: tower"), (480, 800)),
    "overlay/clock": (gettext_lazy("Overlay: clock"), (640, 200)),
    "overlay/lower-third": (gettext_lazy("Overlay: lower third"), (1200, 220)),
    "overlay/next": (gettext_lazy("Overlay: up next"), (480, 320)),
    "overlay/bracket": (gettext_lazy("Overlay: bracket"), (1600, 900)),
}
OVERLAYS = {name.removeprefix("overlay/"): size for name, (_label, size) in SCREENS.items() if "/" in name}
# What a spectators' link opens, by the last part of its address.
WATCHED = {"event": "live_event", "phone": "live_phone", "screen": "live_screen", "overlay": "live_overlay"}
EMOJI = {"clap": "👏", "fire": "🔥", "wow": "😮", "laugh": "😂", "heart": "💜", "flag": "🏁"}
CONNECTED_S = 25  # screens send a heartbeat every ten seconds
MAX_SENTENCES = 80
SAME_FOR_S = 0.25  # less than a page waits before it asks for what it has just played (live/commentary.js)
_COMMENTARIES: Unchanged[dict[str, object]] = Unchanged(32)


@require_safe
def live_screen(request: HttpRequest, slug: str) -> HttpResponse:
    """The big screen: no controls, readable from the back of a room."""
    race, event = _watched(request, slug)
    return _screen(
        request,
        "races/live/screens/screen.html",
        race,
        event,
        html_class="screen",
        beat="screen",
        default_theme=theme(request),
        code=qr_code(follow_address(request, race, event)),
    )


@require_safe
def live_beat(request: HttpRequest, slug: str) -> HttpResponse:
    """Take a screen's heartbeat, for the console's lamp."""
    name = request.GET.get("screen", "")
    race, _event = _watched(request, slug)
    if name not in SCREENS:
        raise Http404
    cache.set(_heartbeat(race, name), 1, CONNECTED_S)
    return _fresh(HttpResponse(status=204))


@login_required
@require_safe
def live_panel(request: HttpRequest, slug: str) -> HttpResponse:
    """The screens of an event for its organisers: where each opens, its size, and whether one is connected."""
    race = organised_race(request, slug)
    event = LiveEvent.objects.filter(race=race).first()
    return _fresh(render(request, "races/live/screens/panel.html", panel_context(request, race, event)))


def panel_context(request: HttpRequest, race: Race, event: LiveEvent | None) -> dict[str, object]:
    """What the console's panel of screens shows."""
    rows = []
    for name, (label, (width, height)) in SCREENS.items():
        kind, _dash, piece = name.partition("/")
        secret = [spectator_token(race)] if race.visibility == Visibility.INVITATION else []
        view = (f"live_watch_{kind}" if kind != "phone" else "live_watch") if secret else f"live_{kind}"
        address = request.build_absolute_uri(
            reverse(view, args=[*(secret or [race.slug]), *([piece] if piece else [])])
        )
        rows.append(
            {
                "name": name,
                "label": label,
                "address": address,
                "size": f"{width} × {height}" if width else "",
                "code": qr_code(address),
                "is_connected": cache.get(_heartbeat(race, name)) is not None,
            }
        )
    return {"race": race, "event": event, "screens": rows}


@require_safe
def live_overlay(request: HttpRequest, slug: str, piece: str) -> HttpResponse:
    """One piece of a broadcast on a transparent ground."""
    if piece not in OVERLAYS:
        raise Http404
    race, event = _watched(request, slug)
    if event is None and piece != "bracket":
        raise Http404
    return _screen(
        request,
        "races/live/screens/overlay.html",
        race,
        event,
        html_class=f"on-air on-air-{piece}",
        default_theme="dark",
        piece=piece,
        beat=f"overlay/{piece}",
    )


@require_safe
def live_commentary(request: HttpRequest, slug: str) -> HttpResponse:
    """The commentator's page: the event in sentences and facts about each racer."""
    race, event = _shown(request, slug)
    if event is None:
        raise Http404
    context = {"race": race, "event": event} | _commentary(event)
    if "X-Paddock-Parts" in request.headers:  # it renews itself: the rest stays as it is
        return _fresh(render(request, "races/live/screens/commentary_parts.html", context))
    now = timezone.now()
    context |= {"phase": events.phase_of(event, now), "met": met_before(event, request.user, now)}
    return _fresh(render(request, "races/live/screens/commentary.html", context))


def _commentary(event: LiveEvent) -> dict[str, object]:
    """The commentary in the active language, cached briefly for all commentators."""

    def made() -> tuple[dict[str, object], bool]:
        sentences = story_of(event, timezone.now())[:MAX_SENTENCES]
        return {
            "sentences": sentences,
            "facts": facts_of(event),
            "next": events.up_next(event, events.running_order(event)),
        }, True

    key = event.pk, translation.get_language()
    return _COMMENTARIES.get(key, SAME_FOR_S, made) if is_shared() else made()[0]


@require_safe
@ensure_csrf_cookie
def live_phone(request: HttpRequest, slug: str) -> HttpResponse:
    """The show on a phone, with reactions."""
    race, event = _watched(request, slug)
    if event is None:
        raise Http404
    now = timezone.now()
    sent = events.reactions_of(event)
    kinds = [(kind.value, EMOJI[kind.value], kind.label, sent[kind.value]) for kind in ReactionKind]
    context = _context(race, event) | {"duels": duels_of(race) if race.opponents == Opponents.MODELS else None}
    context |= {"beat": "phone", "kinds": kinds, "takes_reactions": events.takes_reactions(event, now)}
    context["is_spectator"] = not events.can_see_live(request.user, event)
    return _fresh(render(request, "races/live/screens/phone.html", context))


@require_POST
def live_react(request: HttpRequest, slug: str) -> HttpResponse:
    """A spectator's reaction: counted, of a session no more than a person sends."""
    _race, event = _shown(request, slug)
    if event is None:
        raise Http404
    if request.session.session_key is None:
        request.session.save()
    by_script = request.headers.get("Accept", "").startswith("application/json")
    try:
        react(
            event=event,
            kind=request.POST.get("kind", ""),
            session=request.session.session_key or "",
            address=address_of(request),
            now=timezone.now(),
        )
    except UserFault as fault:
        if by_script:
            return JsonResponse({"code": fault.code, "detail": str(explain(fault))}, status=fault.reason.status)
        report_fault(request, fault)
    return JsonResponse({"reactions": events.reactions_of(event)}) if by_script else redirect("live_phone", slug)


@require_safe
def live_watch(request: HttpRequest, token: str, page: str = "", piece: str = "") -> HttpResponse:
    """Open a spectators' link: store its token in a cookie and redirect to the requested page."""
    race = race_of_token(token)
    if race is None:
        raise Http404
    has_event = LiveEvent.objects.filter(race=race).exists()
    if not has_event and race.opponents != Opponents.MODELS:
        return _unkept(render(request, "races/live/nothing.html", {"race": race}))
    page = page or ("phone" if has_event else "screen")
    address = reverse(WATCHED[page], args=[race.slug, piece] if piece else [race.slug])
    chosen = {name: request.GET[name] for name in ("camera", "language", "theme") if name in request.GET}
    response = redirect(f"{address}?{urlencode(chosen)}" if chosen else address)
    keep_token(request, response, token)
    return _unkept(response)


def _heartbeat(race: Race, name: str) -> str:
    """The cache key of a screen's last heartbeat."""
    return f"live-screen-{race.pk}-{name}"


def follow_address(request: HttpRequest, race: Race, event: LiveEvent | None) -> str:
    """Where the QR code of a screen leads: to the phone's page; of a race by invitation by its spectators' link."""
    if race.visibility == Visibility.INVITATION:
        return request.build_absolute_uri(reverse("live_watch", args=[spectator_token(race)]))
    return request.build_absolute_uri(reverse("live_phone" if event is not None else "race", args=[race.slug]))


def qr_code(address: str) -> str:
    """A QR code of an address as SVG in the page's colours."""
    drawn = segno.make(address, error="m").svg_inline(border=0, omitsize=True, svgclass="qr", lineclass="qr-dark")
    return mark_safe(drawn.replace(' stroke="#000"', ""))  # of our own address, and no text in it


def _shown(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent | None]:
    """The race and its live event, or None for a race of duels, shown by its bracket; 404 for other races."""
    return _with_event(visible_race(request, slug))


def _watched(request: HttpRequest, slug: str) -> tuple[Race, LiveEvent | None]:
    """The same for all spectators, including those with a spectators' link."""
    return _with_event(watched_race(request, slug))


def _with_event(race: Race) -> tuple[Race, LiveEvent | None]:
    event = LiveEvent.objects.select_related(*events.LIVE_RELATED).filter(race=race).first()
    if event is None and race.opponents != Opponents.MODELS:
        raise Http404
    return race, event


def _context(race: Race, event: LiveEvent | None) -> dict[str, object]:
    return {
        "race": race,
        "event": event,
        "phase": None if event is None else events.phase_of(event, timezone.now()),
        "document": None if event is None else shared_document(event, timezone.now()),
        "podium": () if event is None else podium_cards(event),
    }


def podium_cards(event: LiveEvent) -> list[dict[str, object]]:
    """The podium with what belongs to each racer on it: the score, and the car."""
    standings = events.shared_rows(event).standings
    rows = {row.racer.entry.pk: row for row in standings}
    entries = podium_entries(event, standings)
    if not entries:
        return []
    cars = LiveRacer.objects.filter(event=event, entry__in=entries).select_related("model")
    car_of = {car.entry_id: car.model for car in cars}
    return [
        {"place": place, "racer": entry.racer, "row": rows.get(entry.pk), "car": car_of.get(entry.pk)}
        for place, entry in enumerate(entries, start=1)
    ]


def _screen(request: HttpRequest, template: str, race: Race, event: LiveEvent | None, **more: Any) -> HttpResponse:
    """A page without cookies, for broadcasts: the address sets ``?language=`` and ``?theme=``."""
    language = request.GET.get("language", "")
    language = language if translation.check_for_language(language) else translation.get_language() or "en"
    chosen = request.GET.get("theme", "")
    with translation.override(language):
        context = _context(race, event) | more
        context |= {"duels": duels_of(race), "chosen_theme": chosen if chosen in THEMES else "", "language": language}
        return _fresh(render(request, template, context))


def _fresh(response: HttpResponse) -> HttpResponse:
    response["Cache-Control"] = "private, no-store"
    return response


def _unkept(response: HttpResponse) -> HttpResponse:
    """A response without caching, referrer or indexing, for addresses with a token."""
    response["Referrer-Policy"] = "no-referrer"
    response["X-Robots-Tag"] = "noindex"
    return _fresh(response)
