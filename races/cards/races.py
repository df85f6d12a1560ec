"""Cards and embedded boards of races, and cards of their live events."""

from __future__ import annotations

from django.db.models import QuerySet
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from core.cards.registry import CardKind, CardRow, EmbeddedPart, ShareCard
from core.times import written
from races.boards.selectors.board import board, podiums
from races.entries.selectors.visibility import races_visible_to
from races.live.selectors.events import live_events_visible_to, live_standings, phase_of
from races.models import LiveEvent, LiveState, Race, RaceState
from races.models.live import UNDER_WAY
from races.rules.descriptions import score_name, score_words
from races.web.names import named, names_track
from tracks.drawing.cards import map_of

ROWS = 5
EMBEDDED_ROWS = 10
_CANCELLED = LiveState.CANCELLED


def track_line(race: Race) -> str:
    """The track's name, unless the race's names it."""
    return "" if names_track(race.name, race.track.name) else race.track.name


def _card(key: str, hides: bool) -> ShareCard | None:
    race = _race(key)
    if race is None:
        return None
    rows = [] if hides else podiums([race], ROWS)[race.pk]
    shown = tuple(CardRow(str(row.rank), row.alias, score_words(row.entry)) for row in rows)
    lines = tuple(filter(None, (track_line(race), _when(race))))
    note = _("Results are hidden until you watch the race.") if hides else _("No racer classified yet.")
    return ShareCard(
        _("Race"), named(race.name), lines, rows=shown, note="" if shown else note, picture=map_of(race.track)
    )


def _race(key: str) -> Race | None:
    return races_visible_to(None).filter(slug=key).first()


def _when(race: Race) -> str:
    """The state of a race with its time: of the site's zone, as a card has no reader."""
    state = race.state_at(timezone.now())
    if state == RaceState.CANCELLED:
        return _("Cancelled")
    if state == RaceState.CLOSED:
        return _("Closed since %(moment)s") % {"moment": written(race.closes_at)}
    if state == RaceState.OPEN:
        return _("Open until %(moment)s") % {"moment": written(race.closes_at)}
    return _("Opens %(moment)s") % {"moment": written(race.opens_at)}


def _embedded(key: str, hides: bool) -> EmbeddedPart | None:
    race = _race(key)
    if race is None:
        return None
    rows = [] if hides else board(race, per_page=EMBEDDED_ROWS).rows[:EMBEDDED_ROWS]
    context = {"race": race, "hides": hides, "rows": rows, "when": _when(race), "score": score_name(race)}
    return EmbeddedPart("races/cards/board.html", context, 520)


def _public() -> QuerySet[Race]:
    return races_visible_to(None).select_related(None).only("slug", "opens_at").order_by("pk")


def _live_card(key: str, hides: bool) -> ShareCard | None:
    event = live_events_visible_to(None).filter(race__slug=key).first()
    if event is None:
        return None
    race, phase = event.race, phase_of(event, timezone.now())
    ended = phase == LiveState.ENDED and not hides
    standings = live_standings(event)[:ROWS] if ended else []
    rows = tuple(CardRow(str(row.rank), row.racer.entry.shown_name) for row in standings if row.rank is not None)
    if phase in UNDER_WAY:
        note = _("Live now")
    elif phase == _CANCELLED:
        note = _("Cancelled")
    else:
        note = "" if rows else _("Everybody watches each run at the same moment.")
    lines = tuple(filter(None, (track_line(race), written(event.starts_at))))
    return ShareCard(_("Live event"), named(race.name), lines, rows=rows, note=note, picture=map_of(race.track))


def _public_live() -> QuerySet[LiveEvent]:
    return live_events_visible_to(None).exclude(state=_CANCELLED).order_by("pk")


KINDS = (
    CardKind(
        *("race", gettext_lazy("Race"), "race", "slug", _card, _public),
        results="board_json",
        embedded=_embedded,
    ),
    CardKind(
        *("live", gettext_lazy("Live event"), "live_event", "race.slug", _live_card, _public_live),
        results="live_event",
    ),
)
