"""Twenty equal parts of a lap: times, colours, the theoretical best lap and consistency."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .telemetry import LapLine

MINI_SECTORS = 20
PURPLE, GREEN, YELLOW = "purple", "green", "yellow"


def mini_sector_times(line: LapLine) -> np.ndarray:
    """The ms that a lap spent in each mini-sector, NaN where it did not come to the end of one."""
    return np.diff(line.ms_at(np.linspace(0.0, 100.0, MINI_SECTORS + 1)))


def sector_colours(time: np.ndarray, own: np.ndarray, best: np.ndarray | None) -> list[str]:
    """As in racing: purple for the fastest of all runs that are shown, green for the run's own fastest, yellow for a
    slower one, "" without a time. ``own``, ``best``: the fastest times of the run and of all; None for a run alone."""
    colours = []
    for index, one in enumerate(np.round(time).tolist()):
        if np.isnan(one):
            colours.append("")
        elif best is not None and one <= round(float(best[index])):
            colours.append(PURPLE)
        else:
            colours.append(GREEN if one <= round(float(own[index])) else YELLOW)
    return colours


@dataclass(frozen=True)
class RunPace:
    """The laps of a run together. ``fastest``: (20,) ms, its fastest time in each mini-sector, NaN for none;
    ``best_ms``: their sum, the theoretical best lap; ``laps``: the number of complete ones, whose times have the mean
    ``mean_ms`` and the standard deviation ``deviation_ms``; ``least_consistent``: the mini-sector (from 0) whose times
    deviate most."""

    fastest: np.ndarray
    best_ms: int | None
    laps: int
    mean_ms: int | None
    deviation_ms: int | None
    least_consistent: int | None


def pace_of(lines: Sequence[LapLine]) -> RunPace:
    """The pace of a run from all of its laps; one lap alone has no deviation."""
    times = np.array([mini_sector_times(line) for line in lines]).reshape(-1, MINI_SECTORS)
    fastest = np.where(np.isnan(times), np.inf, times).min(axis=0, initial=np.inf)
    fastest[np.isinf(fastest)] = np.nan
    whole = np.array([line.time_ms for line in lines if line.time_ms is not None], np.float64)
    complete = times[[line.time_ms is not None for line in lines]] if lines else times
    several = len(whole) > 1
    return RunPace(
        fastest=fastest,
        best_ms=None if np.isnan(fastest).any() else round(float(fastest.sum())),
        laps=len(whole),
        mean_ms=round(float(whole.mean())) if len(whole) else None,
        deviation_ms=round(float(whole.std(ddof=1))) if several else None,
        least_consistent=int(complete.std(axis=0).argmax()) if several else None,
    )
