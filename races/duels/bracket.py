"""Single elimination: the pairings of each round.

Cars are their seeds, 1 for the best. A tie is two heats, one from each starting order; its winner goes on. A race may
have ties of one heat, the better seed in front, or best of three: the third heat is driven only after one win each (or
a void heat), with the better car of the first two in front. Where a round has fewer cars than
places, the best seeds have a bye.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .points import HeatDrive, points_lap_time

LEGS = 2  # heats in a tie by default
TO_WIN = 2  # of the best of three


@dataclass(frozen=True)
class Tie:
    """Two places of a bracket that meet. ``round`` and ``number`` count from 1, from the top of the tree. ``cars``: the
    seeds known to be in it, the better one first (two, one or none). ``bye``: its only car goes on. ``winner``: None
    while it is open."""

    round: int
    number: int
    cars: tuple[int, ...]
    bye: bool
    winner: int | None

    def heats(self, legs: int = LEGS) -> tuple[tuple[int, ...], ...]:
        """The starting orders of its first heats, the better seed in front first; none unless both cars are known."""
        if len(self.cars) != 2:
            return ()
        return (self.cars, self.cars[::-1])[:legs]


def round_count(entrants: int) -> int:
    """How many rounds there are: the final is the last. None for fewer than two cars."""
    return max(0, entrants - 1).bit_length()


def seeding(entrants: int) -> list[int]:
    """The seeds from the top of the tree to its bottom, byes included as seeds above ``entrants``. The two best can
    only meet in the final, the four best only from the semi-finals on, and so forth."""
    order = [1]
    while len(order) < 1 << round_count(entrants):
        last = 2 * len(order) + 1
        order = [seed for one in order for seed in (one, last - one)]
    return order


def bracket(entrants: int, winners: Mapping[tuple[int, int], int]) -> list[list[Tie]]:
    """All rounds of a bracket; ``winners``: the seed that won the tie (round, number), for those that are decided. Byes
    need no winner. Raises ValueError when a winner is not in its tie."""
    waiting: list[int | None] = [seed if seed <= entrants else None for seed in seeding(entrants)]
    rounds = []
    for number in range(1, round_count(entrants) + 1):
        ties = []
        for place in range(0, len(waiting), 2):
            cars = tuple(sorted(car for car in waiting[place : place + 2] if car is not None))
            bye = number == 1 and len(cars) == 1
            tie = (number, place // 2 + 1)
            winner = cars[0] if bye else winners.get(tie)
            if winner is not None and (winner not in cars or (not bye and len(cars) != 2)):
                raise ValueError(f"seed {winner} cannot win tie {tie} of {cars}")
            ties.append(Tie(*tie, cars, bye, winner))
        rounds.append(ties)
        waiting = [tie.winner for tie in ties]
    return rounds


def tie_winner(cars: Sequence[int], heats: Sequence[Mapping[int, HeatDrive]]) -> int:
    """The winner of a tie: by points, then more laps, then less time for them, then the better seed. ``heats``: the
    drive of each car in each heat, by seed."""

    def key(car: int) -> tuple:
        drives = [heat[car] for heat in heats]
        total = points_lap_time(drives)
        return -total.points, -total.laps, total.time_ms, car

    return min(cars, key=key)


Heats = Mapping[tuple[int, int], Mapping[int, HeatDrive]]


def winners_of(heats: Heats, legs: int = LEGS) -> dict[tuple[int, int], int]:
    """The winner of each tie (round, number) of ``legs`` heats that is decided. ``heats``: the drives by seed of each
    decided heat (round, number)."""
    ties = _by_tie(heats, legs)
    return {tie: tie_winner(list(driven[0]), driven) for tie, driven in ties.items() if _is_decided(driven, legs)}


def deciders(heats: Heats, legs: int) -> dict[tuple[int, int], tuple[int, ...]]:
    """The starting order of each undriven third heat (round, number): in front the better car of the first two."""
    found = {}
    for (round_, tie), driven in _by_tie(heats, legs).items():
        if len(driven) == LEGS < legs and not _is_decided(driven, legs):
            cars = list(driven[0])
            ahead = tie_winner(cars, driven)
            found[round_, heat_number(tie, LEGS, legs)] = (ahead, *(car for car in cars if car != ahead))
    return found


def _by_tie(heats: Heats, legs: int) -> dict[tuple[int, int], list[Mapping[int, HeatDrive]]]:
    ties: dict[tuple[int, int], list[Mapping[int, HeatDrive]]] = {}
    for (round_, number), drives in heats.items():
        ties.setdefault((round_, tie_of(number, legs)), []).append(drives)
    return ties


def _is_decided(driven: Sequence[Mapping[int, HeatDrive]], legs: int) -> bool:
    """Whether the heats of a tie say who goes on."""
    if len(driven) >= legs:
        return True
    if legs <= LEGS:
        return False
    return any(sum(heat[car].points for heat in driven) >= TO_WIN for car in driven[0])


def ties_won(rounds: Sequence[Sequence[Tie]]) -> dict[int, int]:
    """For each seed how many ties it has won, byes included."""
    won: dict[int, int] = {}
    for tie in (tie for ties in rounds for tie in ties):
        for car in tie.cars:
            won.setdefault(car, 0)
        if tie.winner is not None:
            won[tie.winner] += 1
    return won


def heat_number(tie: int, leg: int, legs: int = LEGS) -> int:
    """The number within its round of heat ``leg`` (from 0) of tie ``tie`` (from 1), of ties of ``legs`` heats."""
    return legs * (tie - 1) + leg + 1


def tie_of(number: int, legs: int = LEGS) -> int:
    """The tie that heat ``number`` of a round belongs to. Twin of :func:`heat_number`."""
    return (number - 1) // legs + 1
