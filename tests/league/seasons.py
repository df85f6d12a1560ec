"""Seasons whose boards a test writes by hand."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, date, datetime, timedelta
from typing import Any

from accounts.models import Racer
from league.models import Round, Season
from league.seasons.services.seasons import create_season, schedule_round
from league.standings.selectors.boards import BoardCut, board_cut
from races.boards.selectors.board import board as board_of
from races.events import record_board
from races.models import Entry, Race
from tests.factories import a_racer, a_track

JANUARY = datetime(2027, 1, 1, tzinfo=UTC)
MONTH = timedelta(days=30)
HOUR = timedelta(hours=1)


def a_season(**settings: Any) -> Season:
    """A season of 2027 that promotes a fifth, with finales of three and two places in the championship."""
    usual = {"promotion_percent": 20, "finale_size": 3, "championship_places": 2, "points": [10, 6, 3, 1]}
    return create_season(
        slug="2027", name="2027", starts_on=date(2027, 1, 1), ends_on=date(2027, 12, 31), **(usual | settings)
    )


def a_round(season: Season, number: int, stage: str, **race: Any) -> Round:
    """The race of a stage of month ``number``; its finale is five hours on the tenth day of the next."""
    opens = JANUARY + MONTH * (number - 1)
    closes = opens + MONTH
    if stage == "pro-finale":
        opens = closes + timedelta(days=10)
        closes = opens + 5 * HOUR
    if stage == "championship":
        opens, closes = opens + timedelta(days=20), closes + timedelta(days=20)
    times = {"opens_at": opens, "closes_at": closes, "track": a_track(), "name": f"Month {number} {stage}"}
    times |= {"now": JANUARY}
    return schedule_round(season=season, number=number, stage=stage, month=f"Month {number}", **(times | race))


def racers(count: int) -> list[Racer]:
    return [a_racer() for _ in range(count)]


def board(race: Race, order: Iterable[Racer], *, first_ms: int = 30_000, **fields: Any) -> list[Entry]:
    """Put racers on a board in this order, a second apart; who is in already gets the time."""
    entries = []
    for place, racer in enumerate(order):
        score = first_ms + 1000 * place
        entries.append(stand(race, racer, score, **fields))
    return entries


def stand(race: Race, racer: Racer, score_ms: int, **fields: Any) -> Entry:
    """Give a racer this standing in a race."""
    entry = Entry.objects.filter(race=race, racer=racer).first() or Entry(race=race, racer=racer)
    standing = {
        "classified": True,
        "score_ms": score_ms,
        "rank_score": score_ms,
        "average_ms": score_ms,
        "best_lap_ms": score_ms,
        "rank_lap": score_ms,
        "complete_laps": 3,
        "achieved_at": race.opens_at + HOUR,
    }
    for name, value in (standing | fields).items():
        setattr(entry, name, value)
    entry.save()
    record_board(race)
    return entry


def after(round_: Round, **more: Any) -> datetime:
    """A moment after the race has closed."""
    return round_.race.closes_at + timedelta(**(more or {"minutes": 1}))


def cut_of(round_: Round) -> BoardCut | None:
    """The line through the first page of the board of a round."""
    shown = board_of(round_.race)
    ranks = {row.entry.racer_id: row.rank for row in shown.rows if row.rank is not None}
    return board_cut(round_, shown.classified_count, ranks)
