"""From rows to what marks are computed from."""

from collections.abc import Iterable
from datetime import datetime
from decimal import Decimal
from typing import TypedDict

from ..marking.facts import AssignmentRules, AttemptFacts, PartRules, PassParams, TrackRun
from ..models import Assignment, AssignmentPart, Attempt, TrackKind


class StoredPart(TypedDict):
    number: int
    points: str
    pass_rule: str
    pass_params: PassParams


class StoredRules(TypedDict):
    """The rules by which the marks of an assignment are computed, as plain JSON values."""

    due_at: str
    time_zone: str
    late_points_a_day: str
    counts: str
    first_k: int | None
    parts: list[StoredPart]


def stored_rules(assignment: Assignment) -> StoredRules:
    """The present rules."""
    return {
        "due_at": assignment.due_at.isoformat(),
        "time_zone": assignment.time_zone,
        "late_points_a_day": str(assignment.late_points_a_day),
        "counts": assignment.counts,
        "first_k": assignment.first_k,
        "parts": [
            {
                "number": part.number,
                "points": str(part.points),
                "pass_rule": part.pass_rule,
                "pass_params": part.pass_params,
            }
            for part in assignment.parts.all()
        ],
    }


def rules_of(
    assignment: Assignment,
    stored: StoredRules | None = None,
    shown: Iterable[AssignmentPart] | None = None,
) -> AssignmentRules:
    """``stored`` rules, by default those that marks are computed by, with the tracks as they are. ``shown``: the parts
    with their tracks, if they were read."""
    stored = stored or assignment.marked_rules or stored_rules(assignment)
    by_number = {part.number: part for part in shown or assignment.parts.prefetch_related("tracks")}
    parts = []
    for one in stored["parts"]:
        part = by_number[one["number"]]
        tracks = tuple(each.pk for each in part.tracks.all() if each.kind != TrackKind.CANDIDATE)
        parts.append(
            PartRules(
                number=one["number"],
                points=Decimal(one["points"]),
                pass_rule=one["pass_rule"],
                pass_params=one["pass_params"],
                tracks=tracks,
                to_draw=part.hidden_tracks if assignment.drawn_at is None else 0,
            )
        )
    return AssignmentRules(
        due_at=datetime.fromisoformat(stored["due_at"]),
        time_zone=stored["time_zone"],
        parts=tuple(parts),
        late_points_a_day=Decimal(stored["late_points_a_day"]),
        counts=stored["counts"],
        first_k=stored["first_k"],
    )


def facts_of(attempt: Attempt) -> AttemptFacts:
    """An attempt with its runs, which are best prefetched."""
    runs = {run.part_track_id: TrackRun(run.state, tuple(run.laps)) for run in attempt.runs.all()}
    return AttemptFacts(attempt.pk, attempt.accepted_at, runs)
