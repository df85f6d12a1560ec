"""The mark of a student from their attempts."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from decimal import ROUND_HALF_UP, Decimal

from .facts import FIRST_K, LAST, AssignmentRules, AttemptFacts, MarkFacts, PartMark
from .lateness import late_days
from .pass_rules import NOTHING, PASS_RULES, PlaceReached, result_of

Keys = Mapping[int, Sequence[int]]  # of all students by part, ascending
_CENT = Decimal("0.01")


def mark(
    rules: AssignmentRules,
    attempts: Iterable[AttemptFacts],
    *,
    due_at: datetime | None = None,
    keys: Keys | None = None,
) -> MarkFacts:
    """The mark of a student or a submission group from the attempts that were not given back.

    ``due_at``: the student's own deadline, if it is another; ``keys``: what :func:`place_keys` gave of every student,
    None while places are not known. Of equal attempts the earlier counts."""
    eligible = eligible_attempts(rules, attempts)
    if not eligible:
        parts = tuple(PartMark(NOTHING, False, "not_driven", number=part.number) for part in rules.parts)
        return MarkFacts(None, _rounded(NOTHING), _rounded(NOTHING), 0, parts, is_complete=True)
    due = due_at or rules.due_at
    marked = [_marked(rules, attempt, due, keys) for attempt in eligible]
    best = max(marked, key=lambda one: (one.mark.points, -one.accepted_at.timestamp(), -(one.mark.attempt or 0)))
    return replace(best.mark, is_complete=all(one.mark.is_complete for one in marked))


def eligible_attempts(rules: AssignmentRules, attempts: Iterable[AttemptFacts]) -> list[AttemptFacts]:
    """The attempts that may count, in the order in which they were accepted."""
    in_order = sorted(attempts, key=lambda one: (one.accepted_at, one.id))
    if rules.counts == LAST:
        return in_order[-1:]
    return in_order[: rules.first_k] if rules.counts == FIRST_K else in_order


def place_keys(rules: AssignmentRules, attempts: Iterable[AttemptFacts]) -> dict[int, int]:
    """For each part that is marked by place, the best key of a student's attempts that may count."""
    keys: dict[int, int] = {}
    eligible = eligible_attempts(rules, attempts)
    for part in rules.parts:
        rule = PASS_RULES[part.pass_rule]
        if not isinstance(rule, PlaceReached):
            continue
        of_part = (rule.key(result_of(part.tracks, one.runs, part.to_draw), part.pass_params) for one in eligible)
        if known := [key for key in of_part if key is not None]:
            keys[part.number] = min(known)
    return keys


@dataclass(frozen=True)
class _Marked:
    accepted_at: datetime
    mark: MarkFacts


def _marked(rules: AssignmentRules, attempt: AttemptFacts, due_at: datetime, keys: Keys | None) -> _Marked:
    parts = []
    for part in rules.parts:
        rule = PASS_RULES[part.pass_rule]
        result = result_of(part.tracks, attempt.runs, part.to_draw)
        if isinstance(rule, PlaceReached) and keys is not None:
            key = rule.key(result, part.pass_params)
            place = None if key is None else 1 + bisect_left(keys.get(part.number, ()), key)
            result = replace(result, place=place)
        parts.append((replace(rule.points(result, part.pass_params, part.points), number=part.number), result))
    before = sum((one.points for one, _result in parts), NOTHING)
    days = late_days(attempt.accepted_at, due_at, rules.time_zone)
    points = max(NOTHING, before - days * rules.late_points_a_day)
    complete = all(one.passed is not None and not result.waits for one, result in parts)
    marks = tuple(one for one, _result in parts)
    return _Marked(
        attempt.accepted_at, MarkFacts(attempt.id, _rounded(points), _rounded(before), days, marks, complete)
    )


def _rounded(points: Decimal) -> Decimal:
    return points.quantize(_CENT, ROUND_HALF_UP)
