"""The series of a class (points by place over its races) and the progress of its learners."""

from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import datetime

from django.db.models import Count

from accounts.models import ClassLearner, Classroom, Racer
from races.boards.selectors.board import CLASSIFIED, ORDER
from races.models import Entry, Race
from training.models import TrainingJob

POINTS = (25, 18, 15, 12, 10, 8, 6, 4, 2, 1)  # a season's default
RACES = 20  # the newest


@dataclass
class SeriesRow:
    """A racer: ``cells`` has the place in each race of the series, None where there is none."""

    racer: Racer
    place: int = 0
    points: int = 0
    cells: list[int | None] = field(default_factory=list)

    @property
    def key(self) -> tuple[int, list[int], str]:
        return -self.points, sorted(place for place in self.cells if place is not None), self.racer.alias


@dataclass(frozen=True)
class Series:
    """``races``: oldest first. ``rows``: racers with a place in a race; open races count with their present
    standing."""

    races: list[Race]
    rows: list[SeriesRow]
    is_provisional: bool


def series_of(classroom: Classroom, now: datetime, without: Collection[int] = ()) -> Series:
    """The races of a class that have begun, without those of the ids ``without``. Two queries."""
    races = Race.objects.filter(group=classroom.group_id, cancelled_at=None, opens_at__lte=now).exclude(pk__in=without)
    shown = list(races.order_by("-opens_at", "-pk")[:RACES])[::-1]
    rows: dict[int, SeriesRow] = {}
    ranked = Entry.objects.filter(CLASSIFIED, race__in=shown, withdrawn_at=None, is_baseline=False).order_by(*ORDER)
    by_race: dict[int, list[Entry]] = {race.pk: [] for race in shown}
    for entry in ranked.select_related("racer") if shown else ():
        by_race[entry.race_id].append(entry)
    for at, race in enumerate(shown):
        for place, entry in enumerate(by_race[race.pk], start=1):
            row = rows.setdefault(entry.racer_id, SeriesRow(entry.racer, cells=[None] * len(shown)))
            row.cells[at] = place
            row.points += POINTS[place - 1] if place <= len(POINTS) else 0
    ordered = sorted(rows.values(), key=lambda row: row.key)
    for place, row in enumerate(ordered, start=1):
        alike = place > 1 and row.key[:2] == ordered[place - 2].key[:2]
        row.place = ordered[place - 2].place if alike else place
    return Series(shown, ordered, is_provisional=any(race.closes_at > now for race in shown))


@dataclass(frozen=True)
class LearnerProgress:
    """A learner: opened lessons of the plan, trainings, and the best lap of their latest race of the class."""

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
