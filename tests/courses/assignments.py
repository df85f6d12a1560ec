"""A class with students, and assignments whose runs drive what a test chooses."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from accounts.models import GroupMember, Racer, RacerGroup
from courses.assignments.services import (
    change_assignment,
    extend,
    make_assignment,
    make_submission_group,
    publish_assignment,
)
from courses.attempts.services import add_reference, submit_attempt
from courses.marks.services import propose_regrade
from courses.models import Assignment, Attempt, AttemptRun
from evaluation.running.queue.jobs import finish_evaluation
from tests.factories import a_model, a_racer, a_track, laps, outcome, start

HOUR, DAY = timedelta(hours=1), timedelta(days=1)
PASS = {"title": "Laps", "points": 100, "pass_rule": "laps_in_row", "pass_params": {"laps": 3}}


def a_group(leader: Racer, students: int, now: datetime, name: str = "Course") -> tuple[RacerGroup, list[Racer]]:
    """A group with this many confirmed members besides its leader."""
    group = RacerGroup.objects.create(slug=name.lower(), name=name, leader=leader, made_at=now)
    racers = [a_racer() for _number in range(students)]
    GroupMember.objects.bulk_create(
        GroupMember(group=group, racer=racer, asked_at=now, confirmed_at=now, confirmed_by=leader)
        for racer in [leader, *racers]
    )
    return group, racers


def a_part(**fields: Any) -> dict[str, Any]:
    """A part on the oval: three complete laps in a row for 100 points."""
    return {**PASS, "rules": {"laps": 5}, "tracks": [(a_track(), "shown")], **fields}


def an_assignment(group: RacerGroup, now: datetime, *, publish: bool = True, **fields: Any) -> Assignment:
    """An assignment that opened an hour ago and is due in a day."""
    values = {"title": "First", "opens_at": now - HOUR, "due_at": now + DAY, "parts": [a_part()], **fields}
    made = make_assignment(group=group, by=group.leader, now=now - 2 * HOUR, **values)
    if publish:
        publish_assignment(assignment=made, by=group.leader, now=now - 2 * HOUR)
        made.refresh_from_db()
    return made


def hand_in(assignment: Assignment, racer: Racer, now: datetime) -> Attempt:
    """A new car of the student's."""
    return submit_attempt(assignment=assignment, racer=racer, model=a_model(racer), now=now)


def finish_run(run: AttemptRun, driven: Sequence[dict[str, Any]], now: datetime) -> None:
    """Let a run of an attempt drive these laps to its end."""
    run.refresh_from_db()
    running = start(run.evaluation, now)
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(driven), now=now)


def finish_all(attempt: Attempt, driven: Sequence[dict[str, Any]], now: datetime) -> None:
    """Let all waiting runs of an attempt drive these laps."""
    for run in attempt.runs.filter(state="waiting"):
        finish_run(run, driven, now)


def assigned_to_students(teacher: Racer, now: datetime) -> tuple[dict[str, dict[str, Any]], Attempt]:
    """An assignment with one of everything that addresses may name, and an attempt: ``all`` has what every address
    below the assignment takes, the others what those of a list take."""
    group, (first, second) = a_group(teacher, 2, now, "Assigned")
    assignment = an_assignment(group, now)
    attempt = hand_in(assignment, first, now)
    finish_all(attempt, laps(9000, 9000, 9000), now)
    extend(assignment=assignment, racer=first, by=teacher, due_at=now + 2 * DAY, last_at=None, reason="", now=now)
    together = make_submission_group(assignment=assignment, by=teacher, name="Red", racers=[second], now=now)
    row = add_reference(assignment=assignment, by=teacher, label="Teacher", model=a_model(teacher), now=now)
    change_assignment(assignment=assignment, by=teacher, now=now, parts=[a_part(points=50)])
    regrade = propose_regrade(assignment=assignment, by=teacher, reason="too many points", now=now)
    named = {
        "all": {"public_id": assignment.public_id, "alias": first.alias},
        "groups": {"number": together.pk},
        "references": {"number": row.pk},
        "regrades": {"number": regrade.pk},
    }
    return named, attempt
