"""What the page of an assignment shows: its parts, a student's attempts with their marks in the open, the board."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from datetime import datetime
from decimal import Decimal
from typing import Any

from django.db.models import Prefetch

from accounts.models import Racer
from core.streams.shared_pieces import shared_value

from ..assignments.wording import why
from ..grading.members import Unit
from ..grading.rules import facts_of, rules_of
from ..marking.calculation import mark as mark_of
from ..marking.facts import AssignmentRules, PartMarkDocument
from ..marking.pass_rules import PASS_RULES
from ..models import (
    Assignment,
    AssignmentPart,
    Attempt,
    Mark,
    PartTrack,
    ReferenceRow,
    RunState,
    Shows,
    SubmissionGroupMember,
    TrackKind,
)
from .selectors import with_runs


@dataclass(frozen=True)
class TrackOfAttempt:
    """A track of a part in an attempt: its run, and what counts of it."""

    track: Any
    run: Any
    passed: bool | None
    value: int | None
    unit: str


@dataclass(frozen=True)
class MarkedPart:
    """A part in an attempt: each number of its rule."""

    part: AssignmentPart
    points: Decimal
    passed: bool | None
    why: str
    tracks: list[TrackOfAttempt]


@dataclass(frozen=True)
class AttemptRow:
    """An attempt with its marks computed in the open; ``counts``: it is the one that the mark is from."""

    attempt: Attempt
    parts: list[MarkedPart]
    before_late: Decimal
    late_days: int
    late_points: Decimal
    points: Decimal
    counts: bool
    waits: bool


@dataclass
class BoardLine:
    """A line of an assignment's board; ``place`` None for a reference row; ``racers``: ids of those whose it is."""

    name: str
    points: Decimal
    passed: int
    place: int | None = None
    racer: Racer | None = None
    is_me: bool = False
    racers: set[int] = field(default_factory=set)


def parts_of(assignment: Assignment) -> list[AssignmentPart]:
    """The parts with their tracks, read once for all readers; nobody changes them."""
    tracks = PartTrack.objects.select_related("track").defer("track__npy").order_by("number")

    def read() -> list[AssignmentPart]:
        return list(AssignmentPart.objects.filter(assignment=assignment).prefetch_related(Prefetch("tracks", tracks)))

    key = ("parts of an assignment", assignment.pk, assignment.rules_version, assignment.drawn_at)
    return shared_value(key, read)


def shown_tracks(part: AssignmentPart) -> list[PartTrack]:
    """The tracks that students may know: never candidates."""
    return [one for one in part.tracks.all() if one.kind != TrackKind.CANDIDATE]


def attempt_rows(
    assignment: Assignment, attempts: Iterable[Attempt], mark: Mark | None, due_at: datetime
) -> list[AttemptRow]:
    """Rows for ``attempts`` of one student, with their runs (:func:`.selectors.with_runs`)."""
    rules = rules_of(assignment, shown=parts_of(assignment))
    parts = {part.number: part for part in parts_of(assignment)}
    return [_row(assignment, rules, parts, one, mark, due_at) for one in attempts]


def _row(
    assignment: Assignment,
    rules: AssignmentRules,
    parts: dict[int, AssignmentPart],
    attempt: Attempt,
    mark: Mark | None,
    due_at: datetime,
) -> AttemptRow:
    alone = mark_of(rules, [facts_of(attempt)], due_at=due_at)
    counts = mark is not None and mark.attempt_id == attempt.pk
    marked = mark.parts if mark is not None and counts else [part.to_dict() for part in alone.parts]
    runs = {run.part_track_id: run for run in attempt.runs.all()}
    rows = [_marked(parts[one["number"]], one, runs) for one in marked if one["number"] in parts]
    points, before = (mark.points, mark.before_late) if mark and counts else (alone.points, alone.before_late)
    waits = any(run.state == RunState.WAITING for run in runs.values())
    days = mark.late_days if mark and counts else alone.late_days
    late_points = min(before, days * rules.late_points_a_day)
    return AttemptRow(attempt, rows, before, days, late_points, points, counts, waits)


def _marked(part: AssignmentPart, one: PartMarkDocument, runs: dict[int, Any]) -> MarkedPart:
    marks = {each["track"]: each for each in one.get("tracks", ())}
    driven = []
    for track in shown_tracks(part):
        mark = marks.get(track.pk)
        unit = PASS_RULES[part.pass_rule].unit
        passed, value = (mark["passed"], mark["value"]) if mark else (None, None)
        driven.append(TrackOfAttempt(track.track, runs.get(track.pk), passed, value, unit))
    reason = why(one["why"], part.pass_rule, one.get("why_params", {}))
    return MarkedPart(part, Decimal(one["points"]), one["passed"], reason, driven)


def board_of(assignment: Assignment, unit: Unit | None) -> list[BoardLine]:
    """The board as students may see it, ``unit``'s line marked: empty where they see their own result only.

    A submission group has one line; reference rows stand where their points place them, unranked."""
    if assignment.shows == Shows.OWN:
        return []
    lines = shared_value(("board of an assignment", assignment.pk, assignment.shows), lambda: _board(assignment))
    mine = set(unit.racers) if unit is not None else set()
    return [replace(line, is_me=bool(mine & line.racers)) for line in lines]


def _board(assignment: Assignment) -> list[BoardLine]:
    """The board, read once for all readers."""
    named = assignment.shows == Shows.NAMED
    members = SubmissionGroupMember.objects.filter(assignment=assignment).select_related("group")
    group_of = {member.racer_id: member.group for member in members}
    marks = Mark.objects.filter(assignment=assignment, attempt__isnull=False).select_related("racer")
    lines: list[BoardLine] = []
    of_group: dict[int, BoardLine] = {}
    for mark in marks.order_by("-points", "attempt__accepted_at", "pk"):
        group = group_of.get(mark.racer_id)
        if group is not None and group.pk in of_group:
            of_group[group.pk].racers.add(mark.racer_id)
            continue
        passed = sum(bool(part["passed"]) for part in mark.parts)
        name = group.name if group else mark.racer.shown_name
        racer = mark.racer if named and group is None else None
        lines.append(BoardLine(name if named else "", mark.points, passed, racer=racer, racers={mark.racer_id}))
        if group is not None:
            of_group[group.pk] = lines[-1]
    for at, line in enumerate(lines):
        line.place = lines[at - 1].place if at and lines[at - 1].points == line.points else at + 1
    for line in reference_lines(assignment):
        at = next((n for n, other in enumerate(lines) if other.points < line.points), len(lines))
        lines.insert(at, line)
    return lines


def reference_lines(assignment: Assignment) -> list[BoardLine]:
    """The reference rows, marked like attempts in time."""
    rows = list(ReferenceRow.objects.filter(assignment=assignment).order_by("pk"))
    if not rows:
        return []
    attempts = {one.pk: one for one in with_runs(Attempt.objects.filter(reference_row__in=rows))}
    rules = rules_of(assignment, shown=parts_of(assignment))
    lines = []
    for row in rows:
        attempt = attempts[row.attempt_id]
        found = mark_of(rules, [facts_of(attempt)], due_at=max(attempt.accepted_at, rules.due_at))
        passed = sum(bool(part.passed) for part in found.parts)
        lines.append(BoardLine(row.label, found.before_late, passed))
    return lines
