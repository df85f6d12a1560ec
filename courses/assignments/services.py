"""Makes, changes, publishes, copies and deletes assignments; extensions, submission groups."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo, available_timezones

from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import QuerySet
from django.forms import DateTimeField
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer, RacerGroup
from accounts.quotas import limit_of, used_by
from core.audit.recording import audited
from core.database.after_commit import after_commit
from core.database.locks import hold
from core.events import record
from evaluation.models import Evaluation
from evaluation.running.results import delete_files, files_of_runs
from paddock.errors import UserFault
from races.errors import RaceRefused, problem
from tracks.models import Track

from ..events import ASSIGNMENT_PUBLISHED
from ..grading.members import can_teach_group, hold_units, is_student, require_teacher, unit_of, units_of
from ..grading.rules import rules_of, stored_rules
from ..grading.services import differs, everybody_of, marks_by, recompute_marks, reopen_marks, write_marks
from ..models import (
    Assignment,
    Attempt,
    Counts,
    Extension,
    Mark,
    SubmissionGroup,
    SubmissionGroupMember,
    TrackKind,
)
from ..quotas import ASSIGNMENTS
from .parts import CheckedPart, PartValues, checked_parts, refused_at, stored_parts, write_parts

MOMENTS = ("opens_at", "due_at", "last_at")
YEARS = range(2000, 3000)
COLUMNS = (
    *("title", "instructions", "time_zone", "opens_at", "due_at", "last_at", "late_points_a_day"),
    *("attempts_a_day", "attempts_in_all", "counts", "first_k", "shows"),
)


@audited("assignment.created", _("Assignment created"))
@transaction.atomic
def make_assignment(*, group: RacerGroup, by: Racer, now: datetime, **fields: Any) -> Assignment:
    """Make a draft. ``fields``: :data:`COLUMNS` and ``parts`` (:func:`courses.assignments.parts.checked_parts`). Raises
    UserFault("assignment_not_yours" | "assignments_at_once"), and RaceRefused with all problems by field."""
    require_teacher(group, by)
    hold(by)
    limit = limit_of(by, ASSIGNMENTS.name)
    if used_by(by, ASSIGNMENTS.name, now) >= limit:
        raise UserFault("assignments_at_once", limit=limit)
    assignment = Assignment(group=group, created_by=by, created_at=now)
    _write(assignment, **fields)
    return assignment


@audited("assignment.changed", _("Assignment changed"), target="assignment")
@transaction.atomic
def change_assignment(*, assignment: Assignment, by: Racer, now: datetime, **fields: Any) -> Assignment:
    """Change some of the fields of :func:`make_assignment`. Published marks stay until a regrade is applied, unless no
    mark would change. Raises as there, and UserFault("assignment_has_begun" | "assignment_drawn")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    assignment.refresh_from_db()
    before, due_at = stored_rules(assignment), assignment.due_at
    _write(assignment, **fields)
    hides = assignment.parts.filter(hidden_tracks__gt=0).exists()
    if assignment.drawn_at is not None and hides and assignment.due_at > due_at:
        raise UserFault("assignment_drawn")
    if stored_rules(assignment) != before:
        assignment.rules_version += 1
        assignment.save(update_fields=["rules_version"])
        adopt_rules(assignment, now)
    reopen_marks(assignment)
    return assignment


def adopt_rules(assignment: Assignment, now: datetime, *, changing: bool = False) -> bool:
    """Compute marks by the present rules from now on; unless ``changing``, only if no mark changes. Call it with the
    assignment locked. Returns whether it was done."""
    units = units_of(assignment, everybody_of(assignment))
    hold_units(units)
    places = assignment.final_at is not None
    new = marks_by(assignment, rules_of(assignment, stored_rules(assignment)), units, with_places=places)
    if not changing:
        stored = {mark.racer_id: mark for mark in Mark.objects.filter(assignment=assignment)}
        if any(differs(stored[racer], facts) for racer, facts in new.items() if racer in stored):
            return False
    assignment.marked_version, assignment.marked_rules = assignment.rules_version, stored_rules(assignment)
    assignment.save(update_fields=["marked_version", "marked_rules"])
    if assignment.published_at is not None:
        write_marks(assignment, new, now)
    return True


@audited("assignment.published", _("Assignment published"), target="assignment")
@transaction.atomic
def publish_assignment(*, assignment: Assignment, by: Racer, now: datetime) -> bool:
    """Show the assignment to the students. False if it was before. Raises UserFault("assignment_not_yours" |
    "assignment_no_parts")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    assignment.refresh_from_db()
    if assignment.published_at is not None:
        return False
    if not assignment.parts.exists():
        raise UserFault("assignment_no_parts")
    assignment.published_at = now
    assignment.marked_version, assignment.marked_rules = assignment.rules_version, stored_rules(assignment)
    assignment.save(update_fields=["published_at", "marked_version", "marked_rules"])
    record(ASSIGNMENT_PUBLISHED, at=now, subject=assignment.public_id, once=assignment.public_id)
    return True


@audited("assignment.deleted", _("Assignment deleted"), target="assignment")
@transaction.atomic
def delete_assignment(*, assignment: Assignment, by: Racer) -> None:
    """Delete an assignment with its attempts, their runs, and the marks. Raises UserFault("assignment_not_yours")."""
    require_teacher(assignment.group, by)
    delete_assignments([assignment.pk])


def delete_assignments(assignments: Sequence[int]) -> None:
    """Delete assignments by ids, with runs and files. Call it in a transaction."""
    Assignment.objects.filter(pk__in=assignments).delete()


def take_runs_along(sender: object, *, instance: Assignment, **kwargs: object) -> None:
    """Receiver of ``pre_delete`` of an assignment, also when its group goes: runs and files go with it."""
    delete_runs(Evaluation.with_sealed.filter(attempt_run__attempt__assignment=instance))


def delete_runs(evaluations: QuerySet[Evaluation]) -> None:
    """Delete runs of attempts in any state; a worker that drives one finds its lease gone."""
    runs = list(evaluations.values_list("pk", flat=True))
    files = files_of_runs(runs)
    Evaluation.with_sealed.filter(pk__in=runs).delete()
    after_commit(delete_files, files)


@transaction.atomic
def copy_assignments(
    *, from_group: RacerGroup, to_group: RacerGroup, by: Racer, now: datetime, shift: timedelta
) -> list[Assignment]:
    """Make drafts for another group from all assignments of one, without students and attempts, moved by ``shift`` on
    the clocks of their time zones. Raises as :func:`make_assignment`."""
    require_teacher(from_group, by)
    copies = []
    for one in Assignment.objects.filter(group=from_group):
        values = {name: getattr(one, name) for name in COLUMNS}
        for name in MOMENTS:
            local = values[name] and values[name].astimezone(ZoneInfo(one.time_zone))
            values[name] = local and (local + shift).astimezone(UTC)
        tracks = {track.pk: track for track in Track.objects.filter(assignment_parts__part__assignment=one)}
        parts = [
            {**vars(part), "tracks": [(tracks[track], kind) for track, kind in part.tracks]}
            for part in stored_parts(one)
        ]
        copies.append(make_assignment(group=to_group, by=by, now=now, parts=parts, **values))
    return copies


@audited("assignment.extended", _("Extension given"), target="assignment")
@transaction.atomic
def extend(
    *,
    assignment: Assignment,
    racer: Racer,
    by: Racer,
    due_at: datetime,
    last_at: datetime | None,
    reason: str,
    now: datetime,
) -> Extension:
    """Give a student a later deadline, in place of one given before. Raises UserFault("assignment_not_yours" |
    "assignment_student_unknown"), and RaceRefused for a moment that is too early."""
    require_teacher(assignment.group, by)
    if not is_student(racer, assignment.group_id):
        raise UserFault("assignment_student_unknown")
    if far := {name: _far() for name, when in (("due_at", due_at), ("last_at", last_at)) if is_far(when)}:
        raise RaceRefused(ValidationError(far))
    if due_at <= assignment.due_at:
        raise RaceRefused(ValidationError({"due_at": problem("extension_too_early")}))
    if last_at is not None and last_at <= due_at:
        raise RaceRefused(ValidationError({"last_at": problem("assignment_last_before_due")}))
    hold(assignment)
    values = {"due_at": due_at, "last_at": last_at, "reason": reason, "granted_by": by, "granted_at": now}
    granted, _created = Extension.objects.update_or_create(assignment=assignment, racer=racer, defaults=values)
    _recompute(assignment, racer, now)
    return granted


@audited("assignment.extension_ended", _("Extension taken back"), target="assignment")
@transaction.atomic
def end_extension(*, assignment: Assignment, racer: Racer, by: Racer, now: datetime) -> bool:
    """Take an extension back. False if there is none. Raises UserFault("assignment_not_yours")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    deleted, _rows = Extension.objects.filter(assignment=assignment, racer=racer).delete()
    _recompute(assignment, racer, now)
    return bool(deleted)


@audited("assignment.grouped", _("Submission group created"), target="assignment")
@transaction.atomic
def make_submission_group(
    *, assignment: Assignment, by: Racer, name: str, racers: Iterable[Racer], now: datetime
) -> SubmissionGroup:
    """Let students submit together. What they handed in alone before does not count any more. Raises UserFault(
    "assignment_not_yours" | "assignment_student_unknown" | "submission_group_size" | "submission_group_taken" |
    "submission_group_name_taken")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    members = {racer.pk: racer for racer in racers}
    if not members:
        raise UserFault("submission_group_size")
    if not all(is_student(racer, assignment.group_id) for racer in members.values()):
        raise UserFault("assignment_student_unknown")
    if SubmissionGroupMember.objects.filter(assignment=assignment, racer__in=members).exists():
        raise UserFault("submission_group_taken")
    group = SubmissionGroup(assignment=assignment, name=name.strip())
    if SubmissionGroup.objects.filter(assignment=assignment, name=group.name).exists():
        raise UserFault("submission_group_name_taken")
    group.full_clean()
    group.save()
    SubmissionGroupMember.objects.bulk_create(
        SubmissionGroupMember(group=group, assignment=assignment, racer=racer) for racer in members.values()
    )
    _recompute_all(assignment, list(members), now)
    return group


@audited("assignment.ungrouped", _("Submission group deleted"), target="group")
@transaction.atomic
def delete_submission_group(*, group: SubmissionGroup, by: Racer, now: datetime) -> None:
    """Let its students submit alone again. Raises UserFault("assignment_not_yours" | "submission_group_in_use")."""
    assignment = group.assignment
    require_teacher(assignment.group, by)
    hold(assignment)
    if Attempt.objects.filter(submission_group=group).exists():
        raise UserFault("submission_group_in_use")
    members = list(group.members.values_list("racer", flat=True))
    group.delete()
    _recompute_all(assignment, members, now)


def _recompute(assignment: Assignment, racer: Racer, now: datetime) -> None:
    _recompute_all(assignment, unit_of(assignment, racer).racers, now)


def _recompute_all(assignment: Assignment, racers: Iterable[int], now: datetime) -> None:
    reopen_marks(assignment)
    if assignment.published_at is not None:
        recompute_marks(assignment=assignment, racers=list(racers), now=now)


def _write(assignment: Assignment, *, parts: Iterable[PartValues] | None = None, **columns: object) -> None:
    """Check and store columns and parts."""
    if unknown := columns.keys() - set(COLUMNS):
        raise TypeError(f"an assignment has no {', '.join(sorted(unknown))}")
    for name, value in columns.items():
        setattr(assignment, name, value)
    problems = _problems(assignment)
    if problems:
        raise RaceRefused(ValidationError(problems))
    assignment.save()
    if parts is None:
        return
    try:
        checked = checked_parts(parts)
        _check_candidates(assignment.group, checked)
        driven = assignment.drawn_at is not None or Attempt.objects.filter(assignment=assignment).exists()
        if driven and [part.driven for part in checked] != [part.driven for part in stored_parts(assignment)]:
            raise UserFault("assignment_has_begun")
        write_parts(assignment, checked, driven=driven)
    except (UserFault, ValidationError) as fault:
        raise refused_at("parts", fault) from fault


def _check_candidates(group: RacerGroup, parts: Sequence[CheckedPart]) -> None:
    """Refuse candidates that others imported: the importer of a track can find out that it is used."""
    candidates = [track for part in parts for track, kind in part.tracks if kind != TrackKind.SHOWN]
    imported = Track.objects.filter(pk__in=candidates, owner__isnull=False).select_related("owner")
    for track in imported:
        if not can_teach_group(track.owner, group):
            raise problem("assignment_candidate_imported", track=track.name)


def is_far(moment: datetime | None) -> bool:
    """Whether a moment is one that not every calendar and clock can show."""
    return moment is not None and moment.year not in YEARS


def _far() -> ValidationError:
    return ValidationError(DateTimeField.default_error_messages["invalid"], code="invalid")


def _problems(assignment: Assignment) -> dict[str, ValidationError | list[ValidationError]]:
    problems: dict[str, ValidationError | list[ValidationError]] = {}
    try:
        assignment.clean_fields()
    except ValidationError as error:
        problems |= error.error_dict
    problems |= {name: _far() for name in MOMENTS if name not in problems and is_far(getattr(assignment, name))}
    if not problems and assignment.opens_at >= assignment.due_at:
        problems["due_at"] = problem("assignment_closes_before_opening")
    if not problems and assignment.last_at is not None and assignment.last_at <= assignment.due_at:
        problems["last_at"] = problem("assignment_last_before_due")
    if assignment.time_zone not in available_timezones():
        problems["time_zone"] = problem("assignment_time_zone", zone=assignment.time_zone)
    if (assignment.counts == Counts.FIRST_K) != (assignment.first_k is not None):
        problems["first_k"] = problem("assignment_first_k")
    return problems
