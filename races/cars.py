"""The cars of one run: the one that was sent, and those that drove with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from evaluation.models import CarResult, Evaluation

if TYPE_CHECKING:
    from league.models import Racer


@dataclass(frozen=True)
class CarRow:
    """A car of a run with several: its number (0: the one that was sent), its place at the end, from 1, and whose."""

    number: int
    place: int
    racer: Racer
    result: CarResult


def car_rows(evaluation: Evaluation) -> list[CarRow]:
    """The cars of a finished run, winner first; empty for a car that drove without others. Two queries or one."""
    rivals = list(evaluation.rivals.select_related("model__owner"))
    if not rivals:
        return []
    result = evaluation.result
    racers = {0: evaluation.owner} | {rival.number: rival.model.owner for rival in rivals}
    results: dict[int, CarResult] = {0: result} | {rival.number: rival for rival in result.rivals.all()}
    return [
        CarRow(number, place, racers[number], results[number])
        for place, number in enumerate(result.order, start=1)
        if number in results
    ]
