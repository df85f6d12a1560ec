"""Races of real cars: timekeepers, sessions, guests and sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Prefetch, QuerySet
from django.http import HttpRequest

from accounts.models import Viewer
from evaluation.models import TrainedModel

from ..boards.ranking import standing_in
from ..entries.selectors.visibility import can_organise, can_see_race
from ..models import (
    Entry,
    Guest,
    LapCorrection,
    MeasuredLap,
    Race,
    Submission,
    TimedSession,
    Timekeeper,
    TimingSensor,
)


def can_keep_time(racer: Viewer, race: Race) -> bool:
    """Whether the racer may take times in the race of real cars: its organiser, its timekeepers and admins."""
    if not race.physical or racer is None or not racer.is_authenticated:
        return False
    return can_organise(racer, race) or Timekeeper.objects.filter(race=race, racer_id=racer.pk).exists()


def timekeepers_of(race: Race) -> QuerySet[Timekeeper]:
    """The named timekeepers, by alias."""
    return Timekeeper.objects.filter(race=race).select_related("racer").order_by("racer__alias")


def sensors_of(race: Race) -> QuerySet[TimingSensor]:
    """The sensors of a race, those in use first."""
    return TimingSensor.objects.filter(race=race).order_by("revoked_at", "pk")


def guests_of(race: Race) -> QuerySet[Guest]:
    """The guests of a race, unlinked ones first."""
    return Guest.objects.filter(race=race).select_related("entry__racer").order_by("linked_at", "name", "pk")


def sessions_of(race: Race, entry: Entry | None = None) -> QuerySet[TimedSession]:
    """The sessions of a race, or of one entry in it, the latest first, each with its laps and their corrections."""
    corrections = Prefetch("corrections", LapCorrection.objects.select_related("by").order_by("at", "pk"))
    laps = Prefetch("laps", MeasuredLap.objects.order_by("number").prefetch_related(corrections))
    sessions = TimedSession.objects.filter(race=race, discarded_at=None).select_related(
        "entry__racer", "model", "timekeeper", "sensor"
    )
    if entry is not None:
        sessions = sessions.filter(entry=entry)
    return sessions.order_by("-started_at", "-number").prefetch_related(laps)


def timeable_entries(race: Race) -> QuerySet[Entry]:
    """The entries of a race that may be timed, by name."""
    entries = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False).select_related("racer", "model")
    return entries.order_by("racer__alias")


@dataclass(frozen=True)
class Beside:
    """A racer's result in the linked simulated race. ``same_car``: of the model that drove their best session, else of
    their best model."""

    entry: Entry
    simulated_ms: int
    same_car: bool

    @property
    def difference_ms(self) -> int | None:
        """How much longer the real car took."""
        return None if self.entry.score_ms is None else self.entry.score_ms - self.simulated_ms


def beside(race: Race, entries: Sequence[Entry], reader: Viewer) -> list[Beside]:
    """The simulated results of these entries of a race of real cars, in their order; none where the reader may not see
    the simulated race. Three queries."""
    other = race.beside
    if other is None or not can_see_race(reader, other):
        return []
    racers = [entry.racer_id for entry in entries]
    scores = dict(
        Entry.objects.filter(race=other, racer__in=racers, withdrawn_at=None, classified=True).values_list(
            "racer", "score_ms"
        )
    )
    models = _models_driven(entries)
    driven = Submission.objects.filter(
        entry__race=other,
        entry__withdrawn_at=None,
        entry__racer__in=racers,
        is_void=False,
        car_of=None,
        network__in=[model.network_id for model in models.values()],
        evaluation__result__engine=other.engine,
    )
    found: dict[tuple[int, Any], int] = {}
    for racer, network, laps in driven.values_list("entry__racer", "network", "evaluation__result__laps"):
        score = standing_in(other, laps).score_ms
        if score is not None:
            found[racer, network] = min(score, found.get((racer, network), score))
    rows = []
    for entry in entries:
        model = models.get(entry.pk)
        same = found.get((entry.racer_id, model.network_id)) if model else None
        simulated = same if same is not None else scores.get(entry.racer_id)
        if simulated is not None:
            entry.model = model
            rows.append(Beside(entry, simulated, same is not None))
    return rows


def _models_driven(entries: Sequence[Entry]) -> dict[int, TrainedModel]:
    """The model of each entry's best session, by the entry."""
    sessions = TimedSession.objects.filter(pk__in=[entry.best_session_id for entry in entries if entry.best_session_id])
    return {one.entry_id: one.model for one in sessions.exclude(model=None).select_related("model") if one.model}


def race_page_part(request: HttpRequest, race: Race, entry: Entry | None) -> dict[str, object]:
    """Whether the reader may take times in the race."""
    return {"can_keep_time": can_keep_time(request.user, race)}
