"""The readers of events of races and runs: everybody who may see the race or the run."""

from typing import Any

from django.db.models import Q

from core.events import Event, register_audience
from evaluation.models import Evaluation
from evaluation.running.events import RUN

from ..events import RACE
from ..models import Race
from .selectors.visibility import can_see_evaluation, can_see_race, evaluations_visible_to, races_visible_to


def register_audiences() -> None:
    def sees_race(viewer: Any, event: Event) -> bool:
        race = Race.objects.filter(pk=event.race).first()
        return race is not None and can_see_race(viewer, race)

    def sees_run(viewer: Any, event: Event) -> bool:
        run = Evaluation.objects.filter(public_id=event.subject).first()
        return run is not None and can_see_evaluation(viewer, run)

    register_audience(RACE, can_see=sees_race, seen=lambda viewer: Q(race__in=races_visible_to(viewer).values("pk")))
    register_audience(
        RUN, can_see=sees_run, seen=lambda viewer: Q(subject__in=evaluations_visible_to(viewer).values("public_id"))
    )
