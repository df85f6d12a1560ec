"""What is kept of a run."""

from __future__ import annotations

from itertools import pairwise

import pytest

from evaluation.running.results import POINTS_PER_LAP, trajectory_of
from tests.evaluation.stubs import HEADER, trace_csv


def test_the_trajectory_has_a_list_of_points_per_lap():
    assert trajectory_of(trace_csv(laps=2, steps=3)) == [
        [[0.5, 0.0, 1.5], [1.0, 0.0, 1.5], [1.5, 0.0, 1.5]],
        [[0.5, 1.0, 1.5], [1.0, 1.0, 1.5], [1.5, 1.0, 1.5]],
    ]


@pytest.mark.parametrize("steps", [1, 2, 239, 240, 241, 479, 480, 481, 1000, 10_001])
def test_a_long_lap_is_thinned_evenly(steps):
    (line,) = trajectory_of(trace_csv(laps=1, steps=steps))
    assert len(line) <= POINTS_PER_LAP
    assert line[0][0] == 0.5
    assert line[-1][0] == steps * 0.5
    gaps = [after[0] - before[0] for before, after in pairwise(line)]
    if steps <= POINTS_PER_LAP:
        assert len(line) == steps
    else:
        assert len(line) > POINTS_PER_LAP / 2 - 1
        assert max(gaps) < 2 * gaps[0] + 1e-9


def test_a_car_waiting_out_a_penalty_adds_no_points():
    trace = trace_csv(laps=1, steps=4).replace(b",in_progress,", b",pause,", 2)
    (line,) = trajectory_of(trace)
    assert [point[0] for point in line] == [1.5, 2.0]


def test_an_empty_trace_has_no_trajectory():
    assert trajectory_of(f"{HEADER}\n".encode()) == []
