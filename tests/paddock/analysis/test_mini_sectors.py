"""Mini-sectors: times, colours, the theoretical best lap and consistency."""

import numpy as np
import pytest

from paddock.analysis.mini_sectors import MINI_SECTORS, mini_sector_times, pace_of, sector_colours
from paddock.analysis.telemetry import LapLine

PERCENT = np.linspace(0.0, 100.0, MINI_SECTORS + 1)


def lap(*sector_ms: int, complete: bool = True) -> LapLine:
    """A lap of these mini-sectors; what is missing takes 500 ms each."""
    times = [*sector_ms, *[500] * (MINI_SECTORS - len(sector_ms))] if complete else sector_ms
    ms = np.concatenate(([0.0], np.cumsum(times)))
    places = PERCENT[: len(ms)]
    steps = np.zeros(len(ms), int)
    return LapLine(1, 0, int(ms[-1]) if complete else None, places, ms, steps, steps.astype(float))


def test_mini_sectors_add_up_to_the_lap():
    times = mini_sector_times(lap(400, 700))
    assert times.tolist()[:3] == [400, 700, 500]
    assert times.sum() == 10_100


def test_a_lap_that_stopped_has_no_time_beyond():
    times = mini_sector_times(lap(400, 700, complete=False))
    assert times.tolist()[:2] == [400, 700]
    assert np.isnan(times[2:]).all()


def test_the_theoretical_best_takes_each_mini_sector_from_its_fastest_lap():
    pace = pace_of([lap(400, 700), lap(600, 450)])
    assert pace.best_ms == 400 + 450 + 18 * 500
    assert pace.best_ms < min(10_100, 10_050)


def test_a_lap_that_stopped_counts_for_the_theoretical_best_only():
    pace = pace_of([lap(400, 700), lap(300, complete=False)])
    assert pace.best_ms == 300 + 700 + 18 * 500
    assert (pace.laps, pace.mean_ms, pace.deviation_ms) == (1, 10_100, None)


def test_consistency_is_the_standard_deviation_of_whole_laps():
    pace = pace_of([lap(500, 500), lap(500, 700), lap(500, 600)])
    assert (pace.laps, pace.mean_ms, pace.deviation_ms, pace.least_consistent) == (3, 10_100, 100, 1)


def test_a_run_that_nowhere_came_far_has_no_best():
    assert pace_of([lap(400, complete=False)]).best_ms is None
    assert pace_of([]).best_ms is None


@pytest.mark.parametrize(("time", "colour"), [(400, "purple"), (450, "green"), (500, "yellow"), (np.nan, "")])
def test_colours_are_those_of_racing(time, colour):
    own, best = np.full(1, 450.0), np.full(1, 400.0)
    assert sector_colours(np.full(1, time), own, best) == [colour]


def test_a_run_alone_has_no_purple():
    assert sector_colours(np.full(1, 450.0), np.full(1, 450.0), None) == ["green"]
