"""How far each learner of a class is."""

from __future__ import annotations

from dataclasses import dataclass

from django.db.models import Count

from accounts.models import ClassLearner, Classroom
from races.models import Entry, Race

from ..models import TrainingJob


@dataclass(frozen=True)
class LearnerProgress:
    """A learner: lessons of the plan that they opened, trainings, and the best lap of their latest race of the class.

    Laps of two races do not compare: their tracks and rules differ.
    """

    learner: ClassLearner
    lessons: int
    trainings: int
    best_lap_ms: int | None
    race: Race | None


def progress_of(classroom: Classroom) -> list[LearnerProgress]:
    """All learners by name: three queries."""
    learners = list(classroom.learners.select_related("racer"))
    ids = [learner.racer_id for learner in learners]
    jobs = TrainingJob.objects.filter(owner__in=ids, deleted_at=None).order_by()
    trainings = dict(jobs.values_list("owner").annotate(Count("pk")))
    raced = Entry.objects.filter(racer__in=ids, race__group=classroom.group_id, withdrawn_at=None)
    lapped = raced.filter(best_lap_ms__isnull=False, race__cancelled_at=None).select_related("race")
    latest = {entry.racer_id: entry for entry in lapped.order_by("race__opens_at", "race")}
    return [
        LearnerProgress(
            one,
            sum(slug in one.lessons for slug in classroom.plan),
            trainings.get(one.racer_id, 0),
            latest[one.racer_id].best_lap_ms if one.racer_id in latest else None,
            latest[one.racer_id].race if one.racer_id in latest else None,
        )
        for one in learners
    ]
