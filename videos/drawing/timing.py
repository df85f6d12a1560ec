"""The timing screen at a moment of a run: lap, clock, sectors with their colours, last and best lap."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paddock.simulator.results import LapDocument

from .motion import Steps

SECTORS = 3
PURPLE, GREEN, YELLOW = "purple", "green", "yellow"
FLASH_MS = 2600  # a lap time is shown so long after the line was crossed


class TimedLap(NamedTuple):
    """A lap in whole ms since the start of the run."""

    number: int
    start_ms: int
    time_ms: int
    complete: bool
    sector_ms: tuple[int, ...]
    off_tracks: int = 0
    crashes: int = 0
    resets: int = 0

    @property
    def end_ms(self) -> int:
        return self.start_ms + self.time_ms


class Clock(NamedTuple):
    """The screen at a moment. ``sectors``: the colours of the running lap's sectors driven so far; ``flash``: the lap
    that was just completed."""

    lap: int
    laps: int
    lap_ms: int
    last_ms: int | None
    best_ms: int | None
    sectors: tuple[str, ...]
    flash: TimedLap | None = None
    flash_age_ms: int = 0


def laps_of(documents: Sequence[LapDocument]) -> list[TimedLap]:
    laps = []
    for one in documents:
        try:
            sectors = tuple(int(time) for time in one.get("sector_ms") or () if time is not None)[:SECTORS]
            number, start_ms, time_ms = int(one["number"]), int(one["start_ms"]), int(one["time_ms"])
            counts = [one.get("off_tracks") or 0, one.get("crashes") or 0, one.get("resets") or 0]
            laps.append(TimedLap(number, start_ms, time_ms, bool(one["complete"]), sectors, *counts))
        except (KeyError, TypeError, ValueError):
            continue
    return laps


def colour_of(time: int, own: int | None, fastest: int | None) -> str:
    """Purple: as fast as the race's best; green: as fast as the run's best; yellow: slower."""
    if fastest is not None and time <= fastest:
        return PURPLE
    return GREEN if own is None or time <= own else YELLOW


class Timing:
    """The statistics of one car's laps."""

    def __init__(self, laps: Sequence[TimedLap], fastest_ms: Sequence[int | None] = ()) -> None:
        self.laps = list(laps)
        self._fastest = (*fastest_ms, *(None,) * SECTORS)[:SECTORS]
        self._colours = [self._compared(lap, self.laps[:index]) for index, lap in enumerate(self.laps)]

    def _compared(self, lap: TimedLap, others: Sequence[TimedLap]) -> tuple[str, ...]:
        """Colours of a lap's sectors against the complete laps among ``others``."""
        timed = [one for one in others if one.complete and len(one.sector_ms) == SECTORS]
        own = [min((one.sector_ms[k] for one in timed), default=None) for k in range(SECTORS)]
        return tuple(colour_of(time, own[k], self._fastest[k]) for k, time in enumerate(lap.sector_ms))

    def live(self, lap: TimedLap) -> tuple[str, ...]:
        """Colours of a lap's sectors against the laps before it."""
        return self._colours[self.laps.index(lap)]

    def final(self, lap: TimedLap) -> tuple[str, ...]:
        """Colours of a lap's sectors among all laps of the run; none for a lap that was not finished."""
        if lap not in self.laps or not lap.complete or len(lap.sector_ms) != SECTORS:
            return ("",) * len(lap.sector_ms)
        return self._compared(lap, self.laps)

    def at(self, moment: float, within: int | None = None) -> Clock:
        """The screen ``moment`` ms after the start of the run. ``within``: the number of the only lap that is shown."""
        if not self.laps:
            return Clock(1, 0, max(round(moment), 0), None, None, ())
        begun = (
            i for i, lap in enumerate(self.laps) if (lap.start_ms <= moment if within is None else lap.number == within)
        )
        index = max(begun, default=0)
        lap = self.laps[index]
        clock = min(max(round(moment - lap.start_ms), 0), lap.time_ms)
        ended = [one for one in self.laps if one.complete and one.end_ms <= moment]
        driven = 0
        for count in range(1, len(lap.sector_ms) + 1):
            # whole milliseconds of three sectors may miss those of the lap by one
            over = count == SECTORS and clock == lap.time_ms
            driven = count if over or sum(lap.sector_ms[:count]) <= clock else driven
        flash = ended[-1] if ended and within is None and moment - ended[-1].end_ms < FLASH_MS else None
        return Clock(
            lap.number,
            len(self.laps),
            clock,
            ended[-1].time_ms if ended else None,
            min((one.time_ms for one in ended), default=None),
            self._colours[index][:driven],
            flash,
            round(moment - flash.end_ms) if flash else 0,
        )

    def was_best(self, lap: TimedLap) -> int | None:
        """The best complete lap before ``lap``, in ms."""
        return min((one.time_ms for one in self.laps if one.complete and one.end_ms < lap.end_ms), default=None)


def standings(steps: Sequence[Steps], moment: float) -> list[tuple[int, float]]:
    """(index of the car, seconds behind the leader) in the order of progress; of equals the first to get there."""
    rows = []
    for index, car in enumerate(steps):
        now = min(moment, float(car.t[-1])) if len(car) else 0.0
        done = float(np.interp(now, car.t, car.done)) if len(car) else 0.0
        reached = float(car.t[np.searchsorted(car.done, done - 1e-9)]) if len(car) and done > 0 else math.inf
        rows.append((-done, reached, index, now))
    rows.sort()
    leader = steps[rows[0][2]]
    result = []
    for minus_done, _, index, now in rows:
        behind = now - float(np.interp(-minus_done, leader.done, leader.t)) if len(leader) else 0.0
        result.append((index, max(behind, 0.0) / 1000.0))
    return result


def written(milliseconds: float | None) -> str:
    """A time as ``m:ss.mmm``; a dash for none."""
    if milliseconds is None:
        return "-"
    minutes, rest = divmod(round(milliseconds), 60_000)
    return f"{minutes}:{rest // 1000:02d}.{rest % 1000:03d}"
