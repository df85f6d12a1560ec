"""A racer's certificate with place and time, one landscape page of A4."""

from dataclasses import dataclass
from datetime import datetime

from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.translation import get_language
from django.utils.translation import gettext as _

from core.times import clock
from paddock.errors import UserFault

from ..boards.ranking import rule_for
from ..boards.selectors.board import rank_of
from ..boards.selectors.counts import totals_of
from ..live.selectors.events import live_standings
from ..models import Entry, LiveEvent, LiveState, Race, RaceState
from ..rules.descriptions import score_words
from ..spoilers.selectors import spoilers_of
from ..web.names import named
from .pdf import ACCENT, LINE, SOFT, Paper

MARGIN_MM = 14.0


@dataclass(frozen=True)
class Placed:
    """A certificate's content. ``score``: the formatted score with its unit; ``best_lap_ms``: None without a lap."""

    race: Race
    racer: str
    rank: int
    of: int
    score: str
    best_lap_ms: int | None
    at: datetime


def ended_event(race: Race) -> LiveEvent | None:
    """The race's live event, if it was driven to its end."""
    event: LiveEvent | None = getattr(race, "live_event", None)
    return event if event is not None and event.state == LiveState.ENDED else None


def is_settled(race: Race, now: datetime) -> bool:
    """Whether a race has results to hand out: its live event has ended, or it has closed and none is to come."""
    if race.cancelled_at is not None:
        return False
    if ended_event(race) is not None:
        return True
    event: LiveEvent | None = getattr(race, "live_event", None)
    return race.state_at(now) == RaceState.CLOSED and (event is None or event.is_over)


def entry_of_certificate(race: Race, alias: str) -> Entry:
    entries = race.entries.select_related("race__organiser", "race__track", "racer")
    return get_object_or_404(entries, racer__alias__iexact=alias, is_baseline=False, withdrawn_at=None)


def require_settled(race: Race, now: datetime) -> None:
    """Raises UserFault("results_not_yet"): also for a race that was called off."""
    if not is_settled(race, now):
        raise UserFault("results_not_yet")


def placed(race: Race, entry: Entry, now: datetime) -> Placed:
    """A racer's place in the ended live event, else on the board. Raises UserFault ``results_not_yet``,
    ``certificate_no_place``."""
    require_settled(race, now)
    event = ended_event(race)
    found = _on_board(race, entry) if event is None else _in_event(event, entry)
    if found is None:
        raise UserFault("certificate_no_place", racer=entry.shown_name)
    return found


def _on_board(race: Race, entry: Entry) -> Placed | None:
    rank = None if entry.is_withdrawn or entry.is_baseline else rank_of(entry)
    if rank is None:
        return None
    totals = totals_of(race)
    best = None if by_best_lap(race) and entry.seed is None else entry.best_lap_ms
    name = _("Points") if entry.seed is not None else rule_for(race).name(race)
    score = f"{name}: {score_words(entry)}"
    return Placed(race, entry.shown_name, rank, totals.classified, score, best, race.closes_at)


def _in_event(event: LiveEvent, entry: Entry) -> Placed | None:
    rows = live_standings(event)
    row = next((row for row in rows if row.racer.entry_id == entry.pk and row.rank is not None), None)
    if row is None or row.rank is None or entry.is_withdrawn or event.ended_at is None:
        return None
    best = None
    if row.standing is not None and row.standing.score_ms is not None:
        score = f"{rule_for(event.race).name(event.race)}: {clock(row.standing.score_ms)}"
        best = None if by_best_lap(event.race) else row.standing.best_lap_ms
    else:
        score = _("Points: %(points)s") % {"points": row.points or 0}
    ranked = sum(each.rank is not None for each in rows)
    return Placed(event.race, entry.shown_name, row.rank, ranked, score, best, event.ended_at)


def by_best_lap(race: Race) -> bool:
    """Whether the score is the best lap, which is then printed once."""
    return rule_for(race).figure == "best_lap_ms"


def certificate(of: Placed, address: str) -> bytes:
    """The PDF, in the present language. ``address``: of the page with the results, for its QR code."""
    name = named(of.race.name)
    title = _("Certificate of %(racer)s") % {"racer": of.racer}
    paper = Paper(landscape=True, title=title, language=get_language() or "en")
    middle, right, bottom = paper.width / 2, paper.width - MARGIN_MM, paper.height - MARGIN_MM
    for inset, colour, width in ((9.0, LINE, 0.3), (10.6, ACCENT, 0.9)):
        corners = [(inset, inset), (paper.width - inset, inset)]
        corners += [(paper.width - inset, paper.height - inset), (inset, paper.height - inset)]
        paper.shape(corners, colour=colour, width=width, closed=True)
    _track(paper, of.race)
    paper.write("PADDOCK", middle, 29, 13, bold=True, colour=ACCENT, align="middle")
    paper.write(_("Certificate"), middle, 43, 30, bold=True, align="middle")
    wide = paper.width - 4 * MARGIN_MM
    size = paper.fitting(of.racer, wide, 40, least=14, bold=True)
    paper.write(of.racer, middle, 76, size, bold=True, align="middle", most=wide)
    paper.rule(middle - 55, 82, middle + 55, 82)
    field = max(of.of, of.rank)
    place = _("Place %(rank)s of %(of)s") % {"rank": of.rank, "of": field}
    if field == 1:
        place = _("Only racer classified")
    paper.write(place, middle, 96, 24, bold=True, colour=ACCENT, align="middle")
    paper.write(name, middle, 111, paper.fitting(name, wide, 19, least=10), align="middle", most=wide)
    paper.write(of.race.track.name, middle, 119, 12, colour=SOFT, align="middle", most=wide)
    paper.write(of.score, middle, 134, 15, bold=True, align="middle", most=wide)
    if of.best_lap_ms is not None:
        words = _("Best lap %(time)s") % {"time": clock(of.best_lap_ms)}
        paper.write(words, middle, 142, 12, colour=SOFT, align="middle")
    paper.write(f"{timezone.localtime(of.at):%Y-%m-%d}", MARGIN_MM + 8, bottom - 7, 11, colour=SOFT)
    if of.race.organiser is not None:
        held = _("Held by %(organiser)s") % {"organiser": of.race.organiser.alias}
        paper.write(held, MARGIN_MM + 8, bottom - 13, 11, colour=SOFT, most=90)
    paper.code(address, right - 30, bottom - 30, 24)
    return paper.bytes()


def _track(paper: Paper, race: Race) -> None:
    """The track's borders, pale behind all that is written."""
    if not race.track.has_shape:
        return
    geometry = race.track.geometry
    x_min, y_min, x_max, y_max = geometry.bounds
    wide, high = paper.width - 60, paper.height - 50
    scale = min(wide / (x_max - x_min), high / (y_max - y_min))
    left, top = (paper.width - scale * (x_max - x_min)) / 2, (paper.height - scale * (y_max - y_min)) / 2
    for line in (geometry.inner, geometry.outer):
        points = [
            (left + scale * (x - x_min), top + scale * (y_max - y))
            for x, y in line[:: max(1, len(line) // 300)].tolist()
        ]
        paper.shape(points, colour=(232, 236, 240), width=0.7, closed=not race.track.is_open)


def race_page_part(request: HttpRequest, race: Race, entry: Entry | None) -> dict[str, object]:
    """Whether the race has results to download that are not hidden from the reader."""
    return {"has_results": not spoilers_of(request).hides(race) and is_settled(race, timezone.now())}
