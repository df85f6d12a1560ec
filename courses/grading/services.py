"""Computes marks and writes them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from datetime import datetime
from decimal import Decimal

from django.db import transaction
from django.db.models import Max, Q

from core.database.locks import hold
from core.events import record

from ..events import MARKS_COMPLETED
from ..marking.calculation import Keys, mark, place_keys
from ..marking.facts import AssignmentRules, AttemptFacts, MarkFacts
from ..marking.pass_rules import PASS_RULES
from ..models import Assignment, Attempt, AttemptRun, Extension, Mark, RunState
from .members import Unit, hold_units, students_of, units_of
from .rules import facts_of, rules_of

BATCH = 500


@transaction.atomic
def recompute_marks(*, assignment: Assignment, racers: Collection[int] | None = None, now: datetime) -> int:
    """Compute the marks of these students (ids; with their submission groups) or of all by the rules of the present
    marks. Returns how many have changed."""
    everybody = everybody_of(assignment) if racers is None else racers
    units = units_of(assignment, everybody)
    hold_units(units)
    # a draw or a regrade may have ended while this waited
    assignment.refresh_from_db(fields=["marked_rules", "marked_version", "drawn_at", "final_at"])
    marks = marks_by(assignment, rules_of(assignment), units, with_places=assignment.final_at is not None)
    return write_marks(assignment, marks, now)


@transaction.atomic
def complete_marks(*, assignment: Assignment, now: datetime) -> bool:
    """Once nobody can hand in any more and nothing waits, compute all marks, places too. Returns whether that is so."""
    hold(assignment)
    assignment.refresh_from_db()
    if assignment.final_at is not None or closes_at(assignment) >= now:
        return False
    if assignment.drawn_at is None and any(part.hidden_tracks for part in assignment.parts.all()):
        return False
    waiting = AttemptRun.objects.filter(attempt__assignment=assignment, attempt__is_reference=False)
    if waiting.filter(state=RunState.WAITING, attempt__refunded_at=None).exists():
        return False
    Assignment.objects.filter(pk=assignment.pk).update(final_at=now)
    assignment.final_at = now
    recompute_marks(assignment=assignment, now=now)
    record(MARKS_COMPLETED, at=now, subject=assignment.public_id)
    return True


def reopen_marks(assignment: Assignment) -> None:
    """Marks that were complete are not any more; the clock completes them again."""
    Assignment.objects.filter(pk=assignment.pk, final_at__isnull=False).update(final_at=None)
    assignment.final_at = None


def closes_at(assignment: Assignment) -> datetime:
    """Until when anybody may hand in, extensions included."""
    extended = Extension.objects.filter(assignment=assignment).aggregate(due=Max("due_at"), last=Max("last_at"))
    moments = (assignment.due_at, assignment.last_at, extended["due"], extended["last"])
    return max(moment for moment in moments if moment is not None)


def everybody_of(assignment: Assignment) -> list[int]:
    """The ids of the students, and of those who have left with attempts."""
    of_group = students_of(assignment.group_id).values_list("pk", flat=True)
    tried = Attempt.objects.filter(assignment=assignment, is_reference=False).values_list("racer", flat=True)
    marked = Mark.objects.filter(assignment=assignment).values_list("racer", flat=True)
    return sorted({*of_group, *tried, *marked})


def marks_by(
    assignment: Assignment, rules: AssignmentRules, units: Iterable[Unit], *, with_places: bool
) -> dict[int, MarkFacts]:
    """The marks of these students by ``rules``, by the id of the racer. Writes nothing."""
    units = list(units)
    with_places = with_places and any(PASS_RULES[part.pass_rule].needs_place for part in rules.parts)
    attempts = _attempts_of(assignment, None if with_places else units)
    due = _deadlines(assignment, units)
    keys = _all_keys(rules, attempts) if with_places else None
    marks: dict[int, MarkFacts] = {}
    for unit in units:
        mine = attempts.get(_owner_of(unit), [])
        found = mark(rules, mine, due_at=due.get(unit), keys=keys)
        marks |= dict.fromkeys(unit.racers, found)
    return marks


def deadline_of(assignment: Assignment, unit: Unit) -> tuple[datetime, datetime | None]:
    """When an attempt of these students is due, and until when a late one is accepted: the latest extension counts."""
    extensions = Extension.objects.filter(assignment=assignment, racer__in=unit.racers)
    granted = max(extensions, key=lambda one: (one.due_at, one.last_at or one.due_at), default=None)
    return times_with(assignment, granted)


def times_with(assignment: Assignment, granted: Extension | None) -> tuple[datetime, datetime | None]:
    """:func:`deadline_of` students whose latest extension is ``granted``."""
    if granted is None:
        return assignment.due_at, assignment.last_at
    lasts = [one for one in (granted.last_at, assignment.last_at) if one is not None and one > granted.due_at]
    return granted.due_at, max(lasts, default=None)


def differs(mark: Mark, facts: MarkFacts) -> bool:
    """Whether a student would read other points, in all or of a part."""
    parts = {part.number: part.points for part in facts.parts}
    return mark.points != facts.points or {one["number"]: Decimal(one["points"]) for one in mark.parts} != parts


def write_marks(assignment: Assignment, marks: Mapping[int, MarkFacts], now: datetime) -> int:
    """Write the marks that differ from the stored ones. Returns how many."""
    stored = {one.racer_id: one for one in Mark.objects.filter(assignment=assignment, racer__in=marks)}
    changed = []
    for racer, facts in marks.items():
        new = Mark(
            assignment=assignment,
            racer_id=racer,
            computed_at=now,
            attempt_id=facts.attempt,
            points=facts.points,
            before_late=facts.before_late,
            late_days=facts.late_days,
            parts=[part.to_dict() for part in facts.parts],
            is_complete=facts.is_complete,
            rules_version=assignment.marked_version,
        )
        old = stored.get(racer)
        if old is None or any(getattr(old, name) != getattr(new, name) for name in _COLUMNS):
            changed.append(new)
    Mark.objects.bulk_create(
        changed,
        batch_size=BATCH,
        update_conflicts=True,
        unique_fields=["assignment", "racer"],
        update_fields=[*_COLUMNS, "computed_at"],
    )
    return len(changed)


_COLUMNS = ("attempt_id", "points", "before_late", "late_days", "parts", "is_complete", "rules_version")


_Owner = tuple[str, int]


def _owner_of(unit: Unit) -> _Owner:
    return ("racer", unit.racers[0]) if unit.group is None else ("group", unit.group)


def _attempts_of(assignment: Assignment, units: Collection[Unit] | None) -> dict[_Owner, list[AttemptFacts]]:
    """The attempts that were not given back, by their owners; ``units``: of these only."""
    attempts = Attempt.objects.filter(assignment=assignment, is_reference=False, refunded_at=None)
    if units is not None and len(units) <= BATCH:
        groups = [unit.group for unit in units if unit.group is not None]
        racers = [racer for unit in units if unit.group is None for racer in unit.racers]
        attempts = attempts.filter(Q(submission_group__in=groups) | Q(submission_group=None, racer__in=racers))
    found: dict[_Owner, list[AttemptFacts]] = {}
    for one in attempts.prefetch_related("runs"):
        group = one.submission_group_id
        owner = ("racer", one.racer_id) if group is None else ("group", group)
        found.setdefault(owner, []).append(facts_of(one))
    return found


def _deadlines(assignment: Assignment, units: Iterable[Unit]) -> dict[Unit, datetime]:
    """The latest extension of each."""
    granted = dict(Extension.objects.filter(assignment=assignment).values_list("racer", "due_at"))
    due = {}
    for unit in units:
        if own := [granted[racer] for racer in unit.racers if racer in granted]:
            due[unit] = max(own)
    return due


def _all_keys(rules: AssignmentRules, attempts: Mapping[_Owner, list[AttemptFacts]]) -> Keys:
    keys: dict[int, list[int]] = {}
    for own in attempts.values():
        for part, key in place_keys(rules, own).items():
            keys.setdefault(part, []).append(key)
    return {part: sorted(found) for part, found in keys.items()}
