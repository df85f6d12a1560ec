"""The students of a group by the names that their teachers know."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from accounts.models import Racer, RacerGroup

from ..grading.members import students_of


@dataclass(frozen=True)
class Student:
    """``name``: the real name in a class, else the alias; ``student_id``: by which Moodle or Canvas finds the student,
    ``""`` if no teacher has filled it in. Only teachers see either."""

    racer: Racer
    name: str
    student_id: str


def students_named(group: RacerGroup, others: Iterable[int] = ()) -> list[Student]:
    """The students by name; with racers of the ids ``others``, such as former members. One query, two with
    others."""
    found = {racer.pk: racer for racer in students_of(group).select_related("learner")}
    if left := [pk for pk in others if pk not in found]:
        found |= {racer.pk: racer for racer in Racer.objects.filter(pk__in=left).select_related("learner")}
    return sorted(map(_student, found.values()), key=lambda one: (one.name.casefold(), one.racer.pk))


def _student(racer: Racer) -> Student:
    learner = getattr(racer, "learner", None)
    if learner is None:
        return Student(racer, racer.shown_name, racer.alias)
    return Student(racer, learner.real_name, learner.student_id)


def names_of(students: Iterable[Student]) -> dict[int, str]:
    """Names by the racers' ids."""
    return {one.racer.pk: one.name for one in students}
