"""Places on a board without counting its rows: a few hundred bucket rows at most, however many entries there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from django.db import connection
from django.db.models import IntegerField, OuterRef, QuerySet, Subquery
from django.db.models.functions import Coalesce

from ..models import BoardCount, Entry, Race
from ..models.counting import CLASSIFIED, EVERYBODY, LEVEL_BITS, SHIFTS, TOTAL


@dataclass(frozen=True)
class BoardTotals:
    """How many stand on a board: all rows, racers (without house cars), racers with a rank."""

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
    """How many racers stand before each of these entries on its board, by the entries' ids: one query.

    The buckets of lower scores level by level, and then the entries of the very same score. Said in SQL, for Django
    needs several times as long to put this query together as the database to answer it.
    """
    marks = ", ".join(["%s"] * len(entries))
    with connection.cursor() as cursor:
        cursor.execute(f"{_PLACES} WHERE e.id IN ({marks})", list(entries))
        return {pk: int(place) for pk, place in cursor.fetchall()}


def _places() -> str:
    counts, entry = BoardCount._meta.db_table, Entry._meta.db_table
    levels, above = [], ""
    for shift in SHIFTS:
        levels.append(
            f"COALESCE((SELECT SUM(c.racers) FROM {counts} c WHERE c.race_id = e.race_id AND c.shift = {shift}"
            f"{above} AND c.bucket < (e.rank_score >> {shift})), 0)"
        )
        above = f" AND c.bucket >= ((e.rank_score >> {shift}) << {LEVEL_BITS})"
    ties = (
        f"(SELECT COUNT(*) FROM {entry} o WHERE o.race_id = e.race_id AND o.withdrawn_at IS NULL AND NOT o.is_baseline "
        "AND o.rank_score = e.rank_score "
        "AND (o.rank_lap, o.resets, o.achieved_at, o.id) < (e.rank_lap, e.resets, e.achieved_at, e.id))"
    )
    return f"SELECT e.id, {' + '.join([*levels, ties])} FROM {entry} e"


_PLACES = _places()


def score_at(race: Race, position: int) -> tuple[int, int] | None:
    """The ``rank_score`` of the row at ``position`` (from 0) of a board, and how many of its equals stand before it.

    None beyond the last row. Four queries.
    """
    bucket, left = None, position
    for shift in SHIFTS:
        level = BoardCount.objects.filter(race=race, shift=shift, rows__gt=0)
        if bucket is not None:
            level = level.filter(bucket__gte=bucket << LEVEL_BITS, bucket__lt=(bucket + 1) << LEVEL_BITS)
        for number, rows in level.order_by("bucket").values_list("bucket", "rows"):
            if left < rows:
                bucket = number
                break
            left -= rows
        else:
            return None
    return bucket, left


def page_of(
    entries: QuerySet[Entry], race: Race, order: Sequence[str], offset: int, size: int, rows: int
) -> list[Entry]:
    """``size`` rows of a board from ``offset`` on. ``entries``: all of them in ``order``; ``rows``: how many they are.

    Begins at the row's score instead of passing over everybody before, and at the end of the board for its last rows.
    """
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
