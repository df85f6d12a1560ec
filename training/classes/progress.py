"""How far each learner of a class is."""

from __future__ import annotations

from dataclasses import dataclass

from django.db.models import Count, Min

from accounts.models import ClassLearner, Classroom
from races.models import Entry

from ..models import TrainingJob


@dataclass(frozen=True)
class LearnerProgress:
    """A learner: lessons of the plan that they opened, trainings, and the best lap in the races of the class."""

    learner: ClassLearner
    lessons: int
    trainings: int
    best_lap_ms: int | None


def progress_of(classroom: Classroom) -> list[LearnerProgress]:
    """All learners by name: three queries."""
    learners = list(classroom.learners.select_related("racer"))
    ids = [learner.racer_id for learner in learners]
    jobs = TrainingJob.objects.filter(owner__in=ids, deleted_at=None).order_by()
    trainings = dict(jobs.values_list("owner").annotate(Count("pk")))
    raced = Entry.objects.filter(racer__in=ids, race__group=classroom.group_id, withdrawn_at=None).order_by()
    laps = dict(raced.values_list("racer").annotate(Min("best_lap_ms")))
    return [
        LearnerProgress(
            one,
            sum(slug in one.lessons for slug in classroom.plan),
            trainings.get(one.racer_id, 0),
            laps.get(one.racer_id),
        )
        for one in learners
    ]
