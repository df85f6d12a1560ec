"""Queues the runs of attempts."""

from collections.abc import Iterable
from datetime import datetime

from evaluation.running.queue.services import queue_evaluation

from ..grading.members import unit_of_attempt
from ..grading.rules import facts_of, rules_of
from ..grading.services import deadline_of
from ..marking.calculation import eligible_attempts
from ..models import Assignment, Attempt, AttemptRun, PartTrack, TrackKind


def queue_runs(assignment: Assignment, attempts: Iterable[Attempt], now: datetime) -> int:
    """Queue what these attempts have not driven of the shown and drawn tracks. Call it with the assignment locked."""
    tracks = list(
        PartTrack.objects.filter(part__assignment=assignment)
        .exclude(kind=TrackKind.CANDIDATE)
        .select_related("part", "track")
        .order_by("part__number", "number")
    )
    queued = 0
    for attempt in attempts:
        driven = {run.part_track_id for run in attempt.runs.all()}
        missing = [one for one in tracks if one.pk not in driven]
        if not missing:
            continue
        due_at, _last_at = deadline_of(assignment, unit_of_attempt(attempt))
        in_time = attempt.accepted_at <= due_at and not attempt.is_reference
        for one in missing:
            evaluation = queue_evaluation(
                owner=attempt.racer,
                model=attempt.model,
                track=one.track,
                rules=one.part.race_rules,
                closes_at=due_at if in_time else None,  # in the last hour before others
                checked=True,
                now=now,
            )
            AttemptRun.objects.create(attempt=attempt, part_track=one, evaluation=evaluation)
            queued += 1
    return queued


def queue_hidden_runs(assignment: Assignment, now: datetime) -> int:
    """Queue the runs on drawn tracks of all attempts that may count. Call it with the assignment locked."""
    attempts = Attempt.objects.filter(assignment=assignment, refunded_at=None)
    attempts = attempts.select_related("racer", "model").prefetch_related("runs").order_by("accepted_at", "pk")
    by_owner: dict[tuple[int, int | None], list[Attempt]] = {}
    chosen = []
    for one in attempts:
        if one.is_reference:
            chosen.append(one)
        else:
            owner = (0, one.submission_group_id) if one.submission_group_id else (one.racer_id, None)
            by_owner.setdefault(owner, []).append(one)
    rules = rules_of(assignment)
    for own in by_owner.values():
        may_count = {facts.id for facts in eligible_attempts(rules, map(facts_of, own))}
        chosen += [one for one in own if one.pk in may_count]
    return queue_runs(assignment, sorted(chosen, key=lambda one: (one.accepted_at, one.pk)), now)
