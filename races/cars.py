"""The cars of one run: the one that was sent, and those that drove with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from evaluation.looks import Look, told_apart
from evaluation.models import CarResult, Evaluation

if TYPE_CHECKING:
    from league.models import Racer


@dataclass(frozen=True)
class CarRow:
    """A car of a run: its number (0: the one that was sent), its place at the end, from 1, whose, and what it looks
    like beside the others."""

    number: int
    place: int
    racer: Racer
    result: CarResult
    look: Look


def car_rows(evaluation: Evaluation) -> list[CarRow]:
    """The cars of a finished run, winner first. Two queries, or one for a car that drove without others."""
    rivals = sorted(evaluation.rivals.select_related("model__owner"), key=lambda rival: rival.number)
    result = evaluation.result
    looks = told_apart([evaluation.model.look, *(rival.model.look for rival in rivals)])
    if not rivals:
        return [CarRow(0, 1, evaluation.owner, result, looks[0])]
    worn = dict(zip((0, *(rival.number for rival in rivals)), looks, strict=True))
    racers = {0: evaluation.owner} | {rival.number: rival.model.owner for rival in rivals}
    results: dict[int, CarResult] = {0: result} | {rival.number: rival for rival in result.rivals.all()}
    return [
        CarRow(number, place, racers[number], results[number], worn[number])
        for place, number in enumerate(result.order, start=1)
        if number in results
    ]
