"""The points of heats and the table after them.

A heat gives one point for every car beaten, so a heat of four counts like the three duels that it is for each car. A
car that retires by its own fault, or whose racer has left the race, has lost to every other: it stands behind them and
scores nothing. In a bracket the points on the board are ties won (a bye counts as one); the table decides the ties.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

POINTS: dict[int, tuple[int, ...]] = {2: (1, 0), 3: (2, 1, 0), 4: (3, 2, 1, 0)}


@dataclass(frozen=True)
class HeatDrive:
    """One car's drive in a heat: its place from 1, complete laps and their total time in milliseconds."""

    place: int
    points: int
    laps: int = 0
    time_ms: int = 0


@dataclass(frozen=True)
class HeatsTotal:
    """Several heats together."""

    points: int
    laps: int
    time_ms: int

    @property
    def lap_ms(self) -> int | None:
        """The mean of all complete laps in whole milliseconds, rounded down; None without one."""
        return self.time_ms // self.laps if self.laps else None


def places(order: Sequence[int], lost: Collection[int] = ()) -> dict[int, tuple[int, int]]:
    """For each car of a heat its place and its points. ``order``: every car drawn for the heat, as they stood at the
    end; ``lost``: those that retired or never started. They stand behind the others, in the same order among
    themselves. Raises KeyError for a number of cars that no heat takes, ValueError for a car named twice."""
    if len(set(order)) != len(order):
        raise ValueError(f"a car stands twice in {order}")
    table = POINTS[len(order)]
    standing = [car for car in order if car not in lost] + [car for car in order if car in lost]
    return {
        car: (place, 0 if car in lost else points)
        for place, (car, points) in enumerate(zip(standing, table, strict=True), start=1)
    }


def points_lap_time(drives: Iterable[HeatDrive]) -> HeatsTotal:
    """Points, complete laps and time of several heats, added up."""
    drives = list(drives)
    return HeatsTotal(
        sum(drive.points for drive in drives),
        sum(drive.laps for drive in drives),
        sum(drive.time_ms for drive in drives),
    )


def order(totals: dict[int, HeatsTotal]) -> list[int]:
    """Seeds in the order of the board: more points, then the lower average lap, then the better seed."""

    def key(seed: int) -> tuple:
        lap_ms = totals[seed].lap_ms
        return -totals[seed].points, lap_ms is None, lap_ms or 0, seed

    return sorted(totals, key=key)
