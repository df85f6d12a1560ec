"""Regrades: marks by changed rules, first beside those that stand, then in their place."""

from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.database.locks import hold
from core.events import record
from paddock.errors import UserFault

from ..assignments.services import adopt_rules
from ..events import MARKS_REGRADED
from ..grading.members import require_teacher, units_of
from ..grading.rules import rules_of, stored_rules
from ..grading.services import differs, everybody_of, marks_by, reopen_marks
from ..models import Assignment, Mark, Regrade


@audited("assignment.regrade_proposed", _("Regrade proposed"), target="assignment")
@transaction.atomic
def propose_regrade(*, assignment: Assignment, by: Racer, reason: str, now: datetime) -> Regrade:
    """Compute the marks by the present rules, beside those that stand. Changes none. Raises
    UserFault("assignment_not_yours" | "regrade_done_already")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    assignment.refresh_from_db()
    if not assignment.awaits_regrade:
        raise UserFault("regrade_done_already")
    regrade = Regrade(
        assignment=assignment,
        reason=reason,
        rules_version=assignment.rules_version,
        asked_by=by,
        asked_at=now,
        rows=changed_rows(assignment),
    )
    regrade.full_clean()
    regrade.save()
    return regrade


@audited("assignment.regraded", _("Marks changed by a regrade"), target="assignment")
@transaction.atomic
def apply_regrade(*, assignment: Assignment, regrade: Regrade, by: Racer, now: datetime) -> Regrade:
    """Write the marks as they were shown. Raises UserFault("assignment_not_yours" | "regrade_changed")."""
    require_teacher(assignment.group, by)
    hold(assignment)
    assignment.refresh_from_db()
    regrade.refresh_from_db()
    outdated = regrade.applied_at is not None or regrade.rules_version != assignment.rules_version
    if outdated or not assignment.awaits_regrade or regrade.rows != changed_rows(assignment):
        raise UserFault("regrade_changed")
    adopt_rules(assignment, now, changing=True)
    reopen_marks(assignment)
    regrade.applied_at, regrade.applied_by = now, by
    regrade.save(update_fields=["applied_at", "applied_by"])
    record(MARKS_REGRADED, at=now, subject=assignment.public_id)
    return regrade


def changed_rows(assignment: Assignment) -> list[dict[str, int | str]]:
    """``{racer, old, new}`` of each student whose mark differs by the present rules, by the id of the racer."""
    units = units_of(assignment, everybody_of(assignment))
    rules = rules_of(assignment, stored_rules(assignment))
    new = marks_by(assignment, rules, units, with_places=assignment.final_at is not None)
    old = {mark.racer_id: mark for mark in Mark.objects.filter(assignment=assignment)}
    rows: list[dict[str, int | str]] = []
    for racer, facts in sorted(new.items()):
        if racer in old and differs(old[racer], facts):
            rows.append({"racer": racer, "old": str(old[racer].points), "new": str(facts.points)})
    return rows
