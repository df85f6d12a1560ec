"""The cars of one run: the one that was sent, and those that drove with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from evaluation.looks import VehicleLook, told_apart
from evaluation.models import CompetitorResult, Evaluation, EvaluationRival

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass(frozen=True)
class CompetitorRow:
    """A car of a run: its number (0: the one that was sent), its place at the end, from 1, whose, and what it looks
    like beside the others. ``label``: what it is called there, see :func:`labels_of`."""

    number: int
    place: int
    racer: Racer
    result: CompetitorResult
    look: VehicleLook
    label: str


@dataclass(frozen=True)
class LiveCompetitor:
    """A car of a run that waits or drives: number and label as in :class:`CompetitorRow`, whose, and its look.

    ``progress``: what the runner told of it last (``paddock.simulator.race.Progress`` or its ``RivalProgress``),
    with the ``laps`` of the race; empty as long as it has told nothing.
    """

    number: int
    racer: Racer
    look: VehicleLook
    progress: Mapping[str, Any]
    label: str

    @cached_property
    def is_retired(self) -> bool:
        """Whether its network failed, so that it is off the track."""
        return bool(self.progress.get("retired"))

    @property
    def place_key(self) -> tuple:
        """Smaller for the car that leads: farther along, or through all laps in less time."""
        told = self.progress
        return self.is_retired, -told.get("lap", 0), -told.get("percent", 0.0), told.get("total_ms", 0), self.number


def car_rows(evaluation: Evaluation) -> list[CompetitorRow]:
    """The cars of a finished run, winner first. Two queries, or one for a car that drove without others."""
    rivals = _rivals(evaluation)
    looks = _looks(evaluation, rivals)
    result = evaluation.result
    labels = labels_of(evaluation, rivals)
    if not rivals:
        return [CompetitorRow(0, 1, evaluation.model.owner, result, looks[0], labels[0])]
    racers = {0: evaluation.owner} | {rival.number: rival.model.owner for rival in rivals}
    results: dict[int, CompetitorResult] = {0: result} | {rival.number: rival for rival in result.rivals.all()}
    return [
        CompetitorRow(number, place, racers[number], results[number], looks[number], labels[number])
        for place, number in enumerate(result.order, start=1)
        if number in results
    ]


def live_cars(evaluation: Evaluation) -> list[LiveCompetitor]:
    """The cars of a run that waits or drives, by their numbers. One query."""
    rivals = _rivals(evaluation)
    looks = _looks(evaluation, rivals)
    progress = evaluation.progress or {}
    told = dict(enumerate(progress.get("rivals", ()), start=1))
    laps, labels = {"laps": progress.get("laps")}, labels_of(evaluation, rivals)
    return [
        LiveCompetitor(0, evaluation.model.owner, looks[0], progress, labels[0]),
        *(
            LiveCompetitor(
                one.number,
                one.model.owner,
                looks[one.number],
                told[one.number] | laps if one.number in told else {},
                labels[one.number],
            )
            for one in rivals
        ),
    ]


def labels_of(evaluation: Evaluation, rivals: Sequence[EvaluationRival]) -> dict[int, str]:
    """What the cars of a run are called, by their numbers: by their racers, or where one racer has several cars in it
    by their models; those of one name are numbered."""
    named = {0: evaluation.model.owner.alias} | {rival.number: rival.model.owner.alias for rival in rivals}
    if len(set(named.values())) < len(named):
        named = {0: evaluation.model.name} | {rival.number: rival.model.name for rival in rivals}
    seen: dict[str, int] = {}
    labels = {}
    for number, name in named.items():
        seen[name] = seen.get(name, 0) + 1
        labels[number] = name if seen[name] == 1 else f"{name} ({seen[name]})"
    return labels


def _rivals(evaluation: Evaluation) -> list[EvaluationRival]:
    return sorted(evaluation.rivals.select_related("model__owner"), key=lambda rival: rival.number)


def _looks(evaluation: Evaluation, rivals: Sequence[EvaluationRival]) -> dict[int, VehicleLook]:
    """What the cars of a run wear, by their numbers."""
    looks = told_apart([evaluation.model.look, *(rival.model.look for rival in rivals)])
    return dict(zip((0, *(rival.number for rival in rivals)), looks, strict=True))
