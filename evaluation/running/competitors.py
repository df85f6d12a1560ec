"""The competitors of one run, for pages and videos."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from accounts.models import Racer
from evaluation.appearance.looks import VehicleLook, distinguish_looks
from evaluation.models import CompetitorResult, Evaluation, EvaluationRival
from paddock.rules.race import HEAD_TO_HEAD


@dataclass(frozen=True)
class CompetitorRow:
    """A car of a run: its number (0: the submitted one), final place from 1, racer, result, look and label
    (:func:`labels_of`)."""

    number: int
    place: int
    racer: Racer
    result: CompetitorResult
    look: VehicleLook
    label: str


@dataclass(frozen=True)
class LiveCompetitor:
    """A car of a run that waits or drives. ``progress``: the runner's last report
    (``paddock.simulator.results.Progress`` or its ``RivalProgress``), with the ``laps`` of the race, or empty."""

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
        get = self.progress.get
        return self.is_retired, -get("lap", 0), -get("percent", 0.0), get("total_ms", 0), self.number


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
    of_rival = dict(enumerate(progress.get("rivals", ()), start=1))
    laps, labels = {"laps": progress.get("laps")}, labels_of(evaluation, rivals)
    return [
        LiveCompetitor(0, evaluation.model.owner, looks[0], progress, labels[0]),
        *(
            LiveCompetitor(
                one.number,
                one.model.owner,
                looks[one.number],
                of_rival[one.number] | laps if one.number in of_rival else {},
                labels[one.number],
            )
            for one in rivals
        ),
    ]


def labels_of(evaluation: Evaluation, rivals: Sequence[EvaluationRival]) -> dict[int, str]:
    """The labels of a run's cars by number: their racers, or their models where one racer has several cars in it; equal
    names are numbered."""
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
    if evaluation.spec["rules"].get("race_type") != HEAD_TO_HEAD:  # see check_rivals
        return []
    return sorted(evaluation.rivals.select_related("model__owner"), key=lambda rival: rival.number)


def _looks(evaluation: Evaluation, rivals: Sequence[EvaluationRival]) -> dict[int, VehicleLook]:
    looks = distinguish_looks([evaluation.model.look, *(rival.model.look for rival in rivals)])
    return dict(zip((0, *(rival.number for rival in rivals)), looks, strict=True))
