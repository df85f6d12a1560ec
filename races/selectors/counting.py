"""Places on a board without counting its rows: a few hundred bucket rows at most, however many entries there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from django.db.models import Count, IntegerField, OuterRef, Q, Subquery, Sum
from django.db.models.expressions import Combinable
from django.db.models.functions import Coalesce

from ..models import BoardCount, Entry, Race
from ..models.counting import CLASSIFIED, LEVEL_BITS, RACERS, ROWS, SHIFTS, TOTAL


@dataclass(frozen=True)
class BoardTotals:
    """How many stand on a board: all rows, racers (without house cars), racers with a rank."""

    rows: int
    racers: int
    classified: int


def totals_of(race: Race) -> BoardTotals:
    """The totals of a race's board: one query of three rows."""
    found = dict(BoardCount.objects.filter(race=race, shift=TOTAL).values_list("bucket", "rows"))
    return BoardTotals(found.get(ROWS, 0), found.get(RACERS, 0), found.get(CLASSIFIED, 0))


def racers_on_board(race: Combinable | OuterRef) -> Coalesce:
    """Expression for the racers on the board of an outer query's race."""
    count = BoardCount.objects.filter(race=race, shift=TOTAL, bucket=RACERS).values("rows")
    return Coalesce(Subquery(count, output_field=IntegerField()), 0)


def rows_before(race: OuterRef, score: OuterRef) -> Combinable:
    """Expression for the rows of an outer query's race that have a lower ``rank_score``."""
    total: Combinable | None = None
    parent: int | None = None
    for shift in SHIFTS:
        level = Q(race=race, shift=shift, bucket__lt=_bucket(score, shift))
        if parent is not None:
            level &= Q(bucket__gte=_bucket(score, parent).bitleftshift(LEVEL_BITS))
        count = BoardCount.objects.filter(level).order_by().values("race").annotate(total=Sum("rows")).values("total")
        one = Coalesce(Subquery(count, output_field=IntegerField()), 0)
        total = one if total is None else total + one
        parent = shift
    return total


def count_of(entries) -> Coalesce:
    """Expression for how many rows a query set over entries of one race has."""
    count = entries.order_by().values("race").annotate(count=Count("pk")).values("count")
    return Coalesce(Subquery(count, output_field=IntegerField()), 0)


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


def page_of(entries, race: Race, order: Sequence[str], offset: int, size: int, rows: int) -> list[Entry]:
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


def _bucket(score: OuterRef, shift: int) -> Combinable:
    return score.bitrightshift(shift)
