"""Ranks on a board from a few dozen bucket rows instead of its entries."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from django.db import connection
from django.db.models import IntegerField, OuterRef, Q, QuerySet, Subquery
from django.db.models.expressions import RawSQL
from django.db.models.functions import Coalesce

from evaluation.models import Evaluation, State
from paddock.errors.reasons import platform_codes

from ...models import BoardCount, Entry, Race, Redrive, RedriveState, Submission
from ...models.counting import CLASSIFIED, EVERYBODY, LEVEL_BITS, SHIFTS, TOTAL


@dataclass(frozen=True)
class BoardTotals:
    """Counts of a board: all rows, racers (without house cars), racers with a rank."""

    rows: int
    racers: int
    classified: int


def totals_of(race: Race) -> BoardTotals:
    """The totals of a race's board: one query of two rows."""
    found = BoardCount.objects.filter(race=race, shift=TOTAL).values_list("bucket", "rows", "racers")
    totals = {bucket: (rows, racers) for bucket, rows, racers in found}
    rows, racers = totals.get(EVERYBODY, (0, 0))
    return BoardTotals(rows, racers, totals.get(CLASSIFIED, (0, 0))[1])


def racers_on_board(race: OuterRef) -> Coalesce:
    """Expression for the racers on the board of an outer query's race."""
    count = BoardCount.objects.filter(race=race, shift=TOTAL, bucket=EVERYBODY).values("racers")
    return Coalesce(Subquery(count, output_field=IntegerField()), 0)


def places_of(entries: Sequence[int]) -> dict[int, int]:
    """How many racers stand before each of these entries on its board, by the entries' ids: one query. Plain SQL,
    because Django takes several times as long to build it as the database to run it."""
    marks = ", ".join(["%s"] * len(entries))
    with connection.cursor() as cursor:
        cursor.execute(f"{_PLACES} WHERE e.id IN ({marks})", list(entries))
        return {pk: int(place) for pk, place in cursor.fetchall()}


def racers_before(race: Race, key: tuple[int, int, int]) -> int:
    """Number of racers ranked above a new ``Standing.key``, equals included, which came earlier. One query."""
    last = connection.ops.adapt_datetimefield_value(datetime.max.replace(tzinfo=UTC))
    with connection.cursor() as cursor:
        cursor.execute(_BEFORE, (race.pk, *key, last))
        return int(cursor.fetchone()[0])


def with_place(entries: QuerySet[Entry]) -> QuerySet[Any]:
    """``entries`` with ``place``: how many racers stand before each on its board, as in :func:`places_of`."""
    return entries.annotate(place=RawSQL(_places(Entry._meta.db_table), ()))


def _places(entry: str) -> str:
    """SQL for the racers before an entry of the table or alias ``entry``."""
    counts, others = BoardCount._meta.db_table, Entry._meta.db_table
    levels, above = [], ""
    for shift in SHIFTS:
        levels.append(
            f"COALESCE((SELECT SUM(c.racers) FROM {counts} c WHERE c.race_id = {entry}.race_id AND c.shift = {shift}"
            f"{above} AND c.bucket < ({entry}.rank_score >> {shift})), 0)"
        )
        above = f" AND c.bucket >= (({entry}.rank_score >> {shift}) << {LEVEL_BITS})"
    order = "rank_lap", "resets", "achieved_at", "id"
    ties = (
        f"(SELECT COUNT(*) FROM {others} o WHERE o.race_id = {entry}.race_id AND o.withdrawn_at IS NULL "
        f"AND NOT o.is_baseline AND o.rank_score = {entry}.rank_score "
        f"AND ({', '.join(f'o.{name}' for name in order)}) < ({', '.join(f'{entry}.{name}' for name in order)}))"
    )
    return " + ".join([*levels, ties])


_PLACES = f"SELECT e.id, {_places('e')} FROM {Entry._meta.db_table} e"
_NEW = "SELECT %s AS race_id, %s AS rank_score, %s AS rank_lap, %s AS resets, %s AS achieved_at, 0 AS id"
_BEFORE = f"SELECT {_places('e')} FROM ({_NEW}) AS e"


def score_at(race: Race, position: int) -> tuple[int, int] | None:
    """The ``rank_score`` at ``position`` (from 0) of a board, and its equals before it; None beyond the last row."""
    with connection.cursor() as cursor:
        cursor.execute(_POSITION, {"race": race.pk, "position": position})
        found = cursor.fetchone()
    return None if found is None else (found[0], position - int(found[1]))


def _position() -> str:
    """SQL for the last level's bucket at a position and the rows before it, searched level by level."""
    counts = BoardCount._meta.db_table
    levels = []
    for number, shift in enumerate(SHIFTS):
        above, base, inside = "", "0", ""
        if number:
            above, base = f", level_{number - 1} AS a", "a.passed"
            inside = f" AND c.bucket >= a.bucket << {LEVEL_BITS} AND c.bucket < (a.bucket + 1) << {LEVEL_BITS}"
        running = (
            f"SELECT c.bucket, c.rows AS here, {base} + SUM(c.rows) OVER (ORDER BY c.bucket) - c.rows AS passed "
            f"FROM {counts} AS c{above} WHERE c.race_id = %(race)s AND c.shift = {shift}{inside}"
        )
        levels.append(
            f"level_{number} AS (SELECT bucket, passed FROM ({running}) AS running "
            "WHERE passed <= %(position)s AND %(position)s < passed + here)"
        )
    return f"WITH {', '.join(levels)} SELECT bucket, passed FROM level_{len(SHIFTS) - 1}"


_POSITION = _position()


def page_of(
    entries: QuerySet[Entry], race: Race, order: Sequence[str], offset: int, size: int, rows: int
) -> list[Entry]:
    """``size`` rows of a board from ``offset`` on, read from the row's score, or from the end for the last rows."""
    if offset <= 4 * size:
        return list(entries[offset : offset + size])
    if rows - offset <= 4 * size:
        turned = entries.order_by(*(f"-{name}" for name in order))
        return list(turned[max(0, rows - offset - size) : rows - offset])[::-1]
    found = score_at(race, offset)
    if found is None:
        return []
    score, before = found
    return list(entries.filter(rank_score__gte=score)[before : before + size])


@dataclass(frozen=True)
class DrivenAgain:
    """A race whose counted runs are being driven again: with which ``engine``, how many of how many are ``done``."""

    engine: str
    done: int
    runs: int


def driven_again(race: Race) -> DrivenAgain | None:
    """How far a race is that another engine drives again; None for every other. Two queries, or none."""
    if not race.next_engine:
        return None
    counted = Submission.objects.filter(entry__race=race, is_void=False, evaluation__result__isnull=False)
    ended = Redrive.objects.filter(submission__entry__race=race, state=RedriveState.PENDING, engine=race.next_engine)
    verdict = Q(evaluation__state=State.STOPPED) | Q(evaluation__result__engine=race.next_engine)
    verdict |= Q(evaluation__state=State.FAILED) & ~Q(evaluation__reason_code__in=platform_codes())
    return DrivenAgain(
        race.next_engine,
        ended.filter(verdict).count(),
        counted.exclude(evaluation__result__engine=race.next_engine).count(),
    )


def races_driven_again() -> list[tuple[Race, DrivenAgain]]:
    """Every race that another engine drives again, the next to close first."""
    races = Race.objects.exclude(next_engine="").order_by("closes_at", "pk")
    return [(race, found) for race in races if (found := driven_again(race)) is not None]


def failing_redrives(race: Race) -> list[Redrive]:
    """Of a race that is driven again the runs that have failed through our fault and wait to be tried once more."""
    failed = Redrive.objects.filter(submission__entry__race=race, state=RedriveState.PENDING)
    given_up = Q(evaluation__state=State.FAILED, evaluation__reason_code__in=platform_codes())
    failed = failed.filter(given_up | Q(evaluation__state=State.QUEUED, evaluation__failed_at__isnull=False))
    return list(failed.select_related("evaluation").order_by("pk"))


def cars_waiting(race: Race) -> int:
    """How many cars that are still in the race wait or drive."""
    return Evaluation.objects.filter(
        submission__entry__race=race,
        submission__entry__withdrawn_at=None,
        state__in=(State.QUEUED, State.RUNNING),
    ).count()
