"""Two laps against each other: where one gained on the other, from the traces of both."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from core.streams.shared_pieces import lasting_value
from evaluation.models import Result
from evaluation.running.results import read_trace
from paddock.analysis import telemetry
from paddock.analysis.telemetry import DrivenTrace, LapLine
from paddock.errors import PlatformFault, UserFault
from paddock.simulator.results import LapDocument

POINTS = 200  # of a whole lap: each half a percent of it
_END = 100.0  # percent


@dataclass(frozen=True)
class LapComparison:
    """One lap against another along the way."""

    lap: Annotated[int, "Of the first run."]
    other_lap: Annotated[int, "Of the other run."]
    length_m: Annotated[float, "Of a lap."]
    metres: Annotated[list[float], "From the line, half a percent of a lap apart, as far as both came."]
    gap_ms: Annotated[list[int], "How much later the other was there: more than 0 where the first run is ahead."]
    speed: Annotated[list[float], "Commanded in the first run, m/s."]
    other_speed: Annotated[list[float], "Commanded in the other run, m/s."]

    @property
    def last_gap_ms(self) -> int:
        """The gap where the comparison ends."""
        return self.gap_ms[-1]

    @property
    def is_whole(self) -> bool:
        """Whether both finished the lap."""
        return self.metres[-1] >= self.length_m - 1e-6

    def stretch(self, *, gained: bool, length_m: float = 2.0) -> tuple[float, float, int]:
        """The ``length_m`` metres with the largest gain or loss: from, to, and the difference in ms (0 or more)."""
        metres, gap = np.array(self.metres), np.array(self.gap_ms, float)
        ends = np.minimum(metres + min(length_m, metres[-1]), metres[-1])
        change = np.interp(ends, metres, gap) - gap
        at = int(change.argmax() if gained else change.argmin())
        return float(metres[at]), float(ends[at]), max(0, round(float(change[at] if gained else -change[at])))


def driven_trace(result: Result) -> DrivenTrace:
    """The steps of a run, read once for all that look at them: nobody may change them. Raises PlatformFault
    ``storage_failed``, ``file_damaged``."""

    def read() -> DrivenTrace:
        try:
            return DrivenTrace.of(read_trace(result))
        except ValueError as error:
            raise PlatformFault("file_damaged") from error

    return lasting_value(("driven trace", result.trace_sha256), read)


def lap_line(trace: DrivenTrace, laps: Sequence[LapDocument], number: int) -> LapLine:
    """Lap ``number`` (from 1). Raises UserFault("compare_lap")."""
    line = telemetry.lap_line(trace, laps, number)
    if line is None:
        raise UserFault("compare_lap", lap=number, laps=len(laps))
    return line


def compare(one: LapLine, other: LapLine, length_m: float) -> LapComparison:
    """``one`` against ``other``, both of a lap of ``length_m`` metres."""
    reached = min(one.reached, other.reached)
    percent = np.linspace(0.0, reached, max(2, round(POINTS * reached / _END) + 1))

    def at(line: LapLine, values: np.ndarray) -> np.ndarray:
        return np.interp(percent, line.percent, values)

    return LapComparison(
        lap=one.number,
        other_lap=other.number,
        length_m=round(length_m, 3),
        metres=[round(each * length_m / _END, 3) for each in percent.tolist()],
        gap_ms=[round(each) for each in (at(other, other.ms) - at(one, one.ms)).tolist()],
        speed=[round(each, 2) for each in at(one, one.speed).tolist()],
        other_speed=[round(each, 2) for each in at(other, other.speed).tolist()],
    )


def best_lap(laps: Sequence[LapDocument]) -> int:
    """The number of the lap to begin with: the fastest whole one, else that which came farthest."""
    whole = [lap for lap in laps if lap["complete"]]
    if whole:
        return min(whole, key=lambda lap: lap["time_ms"])["number"]
    return max(laps, key=lambda lap: lap["completion_percentage"])["number"] if laps else 1
