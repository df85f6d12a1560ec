"""How the result of a race of duels stands in a record, whose form has one number for what a race is ranked by.

The old service knew no such races. Their ``RankingScore`` is a number from 2**61 on, which is neither a time nor what
cars without one have (2**62 and more). Smaller is better, as everywhere, and the digits say all that the board ranks
by: bit 60 who was not drawn (then the qualifying time follows), bit 59 a bracket, bits 56 to 58 the cars in a heat less
2; for who was drawn bits 38 to 52 the points that are missing to 32,767, bits 10 to 37 the average lap and the seed
(``rank_lap`` of an entry), bits 0 to 9 the heats. No database here.
"""

from __future__ import annotations

from dataclasses import dataclass

from races.ranking import NO_LAP_MS, SEEDS, drawn_rank

FIRST, LAST = 2**61, 2**62 - 1
MOST_POINTS, MOST_DUELS = 2**15 - 1, 2**10 - 1
_UNDRAWN, _BRACKET, _CARS = 60, 59, 56
_POINTS, _LAP = 38, 10


@dataclass(frozen=True)
class DuelScore:
    """What a result of a race of duels says. ``seed`` None: not drawn, ranked by ``time_ms`` of the qualifying."""

    bracket: bool
    cars: int
    seed: int | None = None
    points: int = 0
    duels: int = 0
    lap_ms: int | None = None
    time_ms: int | None = None

    @property
    def number(self) -> int:
        """The score as it is written."""
        head = FIRST + (int(self.bracket) << _BRACKET) + ((self.cars - 2) << _CARS)
        if self.seed is None:
            return head + (1 << _UNDRAWN) + (self.time_ms or 0)
        _score, lap = drawn_rank(self.points, self.lap_ms, self.seed)
        missing = MOST_POINTS - self.points
        return head + (missing << _POINTS) + (lap << _LAP) + min(self.duels, MOST_DUELS)


def read_duel_score(number: int) -> DuelScore | None:
    """What a score from FIRST to LAST says; None where it says nothing that could be."""
    bracket, cars = bool(number >> _BRACKET & 1), (number >> _CARS & 7) + 2
    if number >> _UNDRAWN & 1:
        found = DuelScore(bracket, cars, time_ms=number & (1 << _CARS) - 1)
    else:
        lap_ms, seed = divmod(number >> _LAP & (1 << _POINTS - _LAP) - 1, SEEDS)
        points = MOST_POINTS - (number >> _POINTS & MOST_POINTS)
        lap = None if lap_ms == NO_LAP_MS else lap_ms
        if not seed or lap_ms > NO_LAP_MS:
            return None
        found = DuelScore(bracket, cars, seed, points, number & MOST_DUELS, lap)
    return found if found.number == number else None
