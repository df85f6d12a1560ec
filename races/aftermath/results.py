"""The results of a race or of its live event as CSV and as PDF."""

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from itertools import accumulate, islice
from typing import Any

from django.utils import timezone
from django.utils.translation import get_language
from django.utils.translation import gettext as _

from core.times import clock, gap

from ..boards.exports import csv_lines
from ..boards.ranking import rule_for
from ..boards.selectors.board import whole_board
from ..live.selectors.events import LiveRow, live_standings
from ..live.selectors.runs import driven_runs
from ..live.statistics import LiveFigures, figure_words, figures_of
from ..models import LiveEvent, Race
from ..rules.descriptions import score_words
from ..web.names import named
from .certificate import MARGIN_MM, by_best_lap, ended_event, require_settled
from .pdf import ACCENT, SOFT, Paper

RESULT_COLUMNS = (
    *("rank", "racer", "country", "qualified_rank", "attempts", "points", "score_ms", "gap_ms", "best_lap_ms"),
    *("average_ms", "total_ms", "complete_laps", "sector_1_ms", "sector_2_ms", "sector_3_ms", "off_tracks", "resets"),
)
LAP_COLUMNS = (
    *("run", "round", "attempt", "heat", "racer", "lap", "complete", "time_ms", "completion_percentage"),
    *("sector_1_ms", "sector_2_ms", "sector_3_ms", "off_tracks", "crashes", "resets"),
)
MOST_ROWS = 500  # of a PDF; a CSV has all
_ROW_MM = 7.0


def event_csv(event: LiveEvent) -> Iterator[str]:
    """A live event's standings as CSV lines, heading first, with empty cells for missing values."""
    return csv_lines(RESULT_COLUMNS, (_result_row(row) for row in live_standings(event)))


def laps_csv(event: LiveEvent) -> Iterator[str]:
    """Every lap of every run of a live event that was shown."""
    return csv_lines(LAP_COLUMNS, _lap_rows(event))


def _result_row(row: LiveRow) -> list[Any]:
    standing, of = row.standing, row.racer.entry
    times: list[int | None] = [None] * 9
    if standing is not None:
        sectors = [*standing.sectors, None, None, None][:3]
        times = [standing.best_lap_ms, standing.average_ms, standing.total_ms, standing.complete_laps, *sectors]
        times += [standing.off_tracks, standing.resets]
    score = None if standing is None else standing.score_ms
    racer = [row.rank, of.shown_name, of.racer.country, row.racer.qualified_rank, row.attempts, row.points]
    return [*racer, score, row.gap_ms, *times]


def _lap_rows(event: LiveEvent) -> Iterator[list[Any]]:
    for number, run in enumerate(driven_runs(event), start=1):
        slot = run.slot
        heat = None if slot.duel is None else slot.duel.number
        for lap in run.laps:
            sectors = [*(lap.get("sector_ms") or ()), None, None, None][:3]
            where = [number, slot.round, slot.attempt, heat, run.alias, lap["number"], bool(lap["complete"])]
            faults = [lap[name] for name in ("off_tracks", "crashes", "resets")]
            yield [*where, lap["time_ms"], lap["completion_percentage"], *sectors, *faults]


def results_pdf(race: Race, now: datetime, address: str) -> bytes:
    """The results of the ended live event with its figures, else of the board. Raises UserFault("results_not_yet")."""
    require_settled(race, now)
    event = ended_event(race)
    name = named(race.name)
    paper = Paper(title=_("Results of %(race)s") % {"race": name}, language=get_language() or "en")
    at = race.closes_at if event is None or event.ended_at is None else event.ended_at
    top = _head(paper, race, name, at, address)
    if event is None:
        top = _table(paper, _board_heading(race), _board_rows(race), top)
    else:
        top = _table(paper, _event_heading(race), _event_rows(live_standings(event)), top)
        _figures(paper, figures_of(event), top + 6)
    for number in range(1, paper.pdf.pages_count + 1):
        paper.pdf.page = number
        words = _("Page %(number)s of %(pages)s") % {"number": number, "pages": paper.pdf.pages_count}
        paper.write(words, paper.width - MARGIN_MM, paper.height - 9, 8, colour=SOFT, align="right")
        paper.write("Paddock", MARGIN_MM, paper.height - 9, 8, colour=SOFT)
    return paper.bytes()


def _head(paper: Paper, race: Race, name: str, at: datetime, address: str) -> float:
    right = paper.width - MARGIN_MM
    most = right - MARGIN_MM - 26
    paper.write(_("Results"), MARGIN_MM, 19, 11, bold=True, colour=ACCENT)
    paper.write(name, MARGIN_MM, 28, paper.fitting(name, most, 20, least=11, bold=True), bold=True, most=most)
    where = f"{race.track.name} · {race.get_race_type_display()} · {timezone.localtime(at):%Y-%m-%d}"
    paper.write(where, MARGIN_MM, 35, 10, colour=SOFT, most=most)
    paper.code(address, right - 20, 14, 20)
    return 46.0


Heading = list[tuple[str, float, bool]]  # word, share of the width, whether to the right


def _board_heading(race: Race) -> Heading:
    return [
        (_("Place"), 0.09, False),
        (_("Racer"), 0.36, False),
        (rule_for(race).name(race), 0.22, True),
        ("" if by_best_lap(race) else _("Best lap"), 0.15, True),
        (_("Laps"), 0.08, True),
        (_("Off tracks"), 0.10, True),
    ]


def _board_rows(race: Race) -> Iterator[list[str]]:
    rows = (row for row in whole_board(race) if not row.is_baseline)
    for row in islice(rows, MOST_ROWS):
        entry = row.entry
        score = score_words(entry) if row.classified else _("not classified")
        counts = [str(entry.complete_laps), str(entry.off_tracks)]
        yield [_place(row.rank), row.alias, score, clock(entry.best_lap_ms), *counts]


def _event_heading(race: Race) -> Heading:
    return [
        (_("Place"), 0.09, False),
        (_("Racer"), 0.33, False),
        (rule_for(race).name(race), 0.22, True),
        (_("Gap"), 0.14, True),
        ("" if by_best_lap(race) else _("Best lap"), 0.14, True),
        (_("Laps"), 0.08, True),
    ]


def _event_rows(rows: Sequence[LiveRow]) -> Iterator[list[str]]:
    for row in rows[:MOST_ROWS]:
        standing = row.standing
        score = "–" if row.points is None else str(row.points)
        best, laps = "–", "–"
        if standing is not None:
            score, best = clock(standing.score_ms), clock(standing.best_lap_ms)
            laps = str(standing.complete_laps)
        name = row.racer.entry.shown_name
        yield [_place(row.rank), name, score, gap(row.gap_ms) if row.gap_ms else "", best, laps]


def _place(rank: int | None) -> str:
    return "–" if rank is None else str(rank)


def _table(paper: Paper, heading: Heading, rows: Iterable[Sequence[str]], top: float) -> float:
    """Draw a table over as many pages as needed, without columns that have no heading; returns where it ends."""
    wide = paper.width - 2 * MARGIN_MM
    edges = list(accumulate((share * wide for _word, share, _right in heading), initial=MARGIN_MM))
    kept = [number for number, (word, _share, _right) in enumerate(heading) if word]
    places, heading = [(edges[number], edges[number + 1]) for number in kept], [heading[number] for number in kept]

    def line(texts: Sequence[str], y: float, **look: Any) -> None:
        for text, (left, end), (_word, _share, right) in zip(texts, places, heading, strict=True):
            most = end - left - 2
            paper.write(text, end if right else left, y, align="right" if right else "left", most=most, **look)

    def head(y: float) -> float:
        line([word for word, _share, _right in heading], y, size=8.5, colour=SOFT)
        paper.rule(MARGIN_MM, y + 2, paper.width - MARGIN_MM, y + 2, width=0.4)
        return y + _ROW_MM

    y = head(top)
    for number, texts in enumerate(rows):
        if y > paper.height - 18:
            paper.pdf.add_page()
            y = head(20.0)
        line([texts[place] for place in kept], y, size=10, bold=number < 3)
        paper.rule(MARGIN_MM, y + 2, paper.width - MARGIN_MM, y + 2)
        y += _ROW_MM
    return y


def _figures(paper: Paper, figures: LiveFigures, top: float) -> None:
    rows = figure_words(figures)
    if top + 6.5 * len(rows) + 8 > paper.height - 16:
        paper.pdf.add_page()
        top = 20.0
    paper.write(_("In figures"), MARGIN_MM, top, 11, bold=True, colour=ACCENT)
    for number, (name, value) in enumerate(rows, start=1):
        y = top + 6.5 * number
        paper.write(name, MARGIN_MM, y, 10, colour=SOFT, most=70)
        paper.write(value, MARGIN_MM + 74, y, 10, bold=True, most=paper.width - 2 * MARGIN_MM - 74)
