"""Races of duels that tests draw, and heats that end as a test chooses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from accounts.models import Racer
from evaluation.models import Evaluation
from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import PlatformFault
from races.boards.selectors.board import board
from races.duels.services import draw_duels, drive_on
from races.models import Duel, DuelState, Entry, Race
from tests import factories
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.factories import a_race, a_racer, drive, laps, start

LAP_MS = 10_000


def a_duel_race(now: datetime, **fields: Any) -> Race:
    """A round robin of pairs that takes cars at ``now`` and closes an hour later."""
    defaults = {
        "race_type": "head_to_head",
        "opponents": "models",
        "duel_format": "round_robin",
        "closes_at": now + timedelta(hours=1),
        "minimum_laps": 1,
        "laps": 3,
    }
    return a_race(now, **(defaults | fields))


def qualify(race: Race, racers: Sequence[Racer], now: datetime) -> None:
    """Let each of them qualify, each slower than the one before."""
    for number, racer in enumerate(racers):
        drive(race, racer, laps(*[LAP_MS + 100 * number] * 3), now)


def drawn(now: datetime, entrants: int, **fields: Any) -> Race:
    """A closed race of duels among ``entrants`` new racers, seed 1 is ``car-1`` and so on, its first heats queued."""
    race = a_duel_race(now, **fields)
    qualify(race, [a_racer(f"car-{number}") for number in range(1, entrants + 1)], now)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    return race


def driving(race: Race) -> list[Duel]:
    """The heats that are in the queue or on track."""
    return list(Duel.objects.filter(race=race, state=DuelState.DRIVING).select_related("evaluation", "race"))


def seeds(duel: Duel) -> list[int]:
    """Who is in a heat, front car first."""
    return list(duel.cars.order_by("grid").values_list("entry__seed", flat=True))


def duel_outcome(order: Sequence[int], times: Mapping[int, Sequence[int]], retired: Sequence[int]) -> EvaluationOutcome:
    """What the pipeline returns for cars 0 to n: who won, what laps each drove, who retired in its last lap."""

    def car(number: int) -> CompetitorOutcome:
        fault = "non_finite_action" if number in retired else ""
        return car_outcome(number, tuple(times.get(number, [LAP_MS] * 3)), retired=fault)

    front = car(0)
    alone = outcome_of(rivals=[car(number) for number in range(1, len(order))], order=list(order))
    return replace(alone, **vars(front))


def end(
    duel: Duel,
    now: datetime,
    *,
    winners: Sequence[int] | None = None,
    times: Mapping[int, Sequence[int]] | None = None,
    retired: Sequence[int] = (),
) -> None:
    """Let a heat be driven to its end.

    ``winners``: seeds in the order at the end (the better seed first unless said); ``times``: milliseconds of the laps
    of a seed; ``retired``: seeds that were removed from the track.
    """
    starting = list(duel.cars.filter(forfeited=False).order_by("grid").values_list("entry__seed", flat=True))
    number = {seed: index for index, seed in enumerate(starting)}
    ordered = [number[seed] for seed in winners or sorted(starting)]
    driven = {number[seed]: laps_ for seed, laps_ in (times or {}).items() if seed in number}
    evaluation = Evaluation.objects.get(duel=duel)
    running = start(evaluation, now)
    result = duel_outcome(ordered, driven, [number[seed] for seed in retired])
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=result, now=now)


def end_all(race: Race, now: datetime, choose: Callable[[list[int]], int] = min) -> int:
    """Drive a race's duels to the last one; ``choose`` picks the winner of a heat's seeds. Returns how many heats."""
    count = 0
    while heats := driving(race):
        for duel in heats:
            cars = seeds(duel)
            best = choose(cars)
            end(duel, now, winners=[best, *(car for car in cars if car != best)])
            count += 1
        drive_on(race=race, now=now)
    return count


def points(race: Race) -> dict[int, tuple[int, int, int | None]]:
    """Points, duels and average lap of each seed."""
    rows = Entry.objects.filter(race=race, seed__isnull=False).order_by("seed")
    return {row.seed: (row.points, row.duels, row.duel_lap_ms) for row in rows}


def ranking(race: Race) -> list[str]:
    """Who stands on the board, the first place first."""
    return [row.alias for row in board(race).rows]


def break_down(duel: Duel, now: datetime) -> None:
    """The evaluation of a heat fails through the platform's fault until it is final."""
    factories.break_down(Evaluation.objects.get(duel=duel), PlatformFault("internal_error"), now)
