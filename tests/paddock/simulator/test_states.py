"""The trace of many states at once is what each row alone comes to, to the bit."""

from __future__ import annotations

import math
import random

import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.simulator.physics import STEP_MS
from paddock.simulator.trace import PAUSE, STATUSES, Row, StepState, Trace, rows_of, trace_of
from tests.soak import only


def row_of(state: StepState, track, start_m: float) -> Row:
    """One row by itself."""
    starts, after = track.cumulative.tolist(), state.segment + 1
    after, end = (after, starts[after]) if after < len(starts) else (0, track.length)
    seconds = state.step * STEP_MS / 1000.0
    driven = state.metres - (start_m + (state.lap - 1) * track.length)
    return Row(
        episode=state.lap - 1,
        steps=float(state.lap_steps),
        X=state.x,
        Y=state.y,
        yaw=math.degrees(state.yaw),
        steer=state.steering_deg,
        throttle=state.speed_mps,
        action=state.index,
        reward=state.reward,
        done=state.ends,
        all_wheels_on_track=state.all_wheels_on_track,
        progress=100.0 if state.has_finished else min(100.0, 100.0 * driven / track.length),
        closest_waypoint=after if end - state.distance < state.distance - starts[state.segment] else state.segment,
        track_len=track.length,
        tstamp=seconds,
        episode_status=state.status,
        pause_duration=state.pause_steps * STEP_MS / 1000.0 if state.status == PAUSE else 0.0,
        obstacle_crash_counter=state.crashes,
        wall_clock=seconds,
    )


def states_on(track, draw: random.Random, count: int):
    for step in range(count):
        x, y, heading = track.point_at(draw.uniform(0.0, track.length), draw.gauss(0.0, 0.2))
        place = track.project(x, y)
        lap = draw.randint(1, 20)
        metres = place.distance + draw.choice((0, lap - 1, lap)) * track.length
        yield StepState(
            lap, draw.randint(1, 500), x, y, heading, draw.uniform(-30.0, 30.0), draw.uniform(0.1, 4.0),
            draw.randint(-1, 20), draw.gauss(0.0, 1.0), draw.random() < 0.1, draw.random() < 0.9, metres,
            draw.random() < 0.1, place.distance, place.index, step, draw.choice(STATUSES), draw.randint(0, 90),
            draw.randint(0, 9),
        )  # fmt: skip


@pytest.mark.parametrize("entry", only(CATALOGUE[:6], CATALOGUE), ids=lambda entry: entry.slug)
def test_all_rows_at_once_are_the_rows_one_by_one(entry):
    draw = random.Random(entry.slug)
    track = entry.geometry()
    for direction in ("ccw", "cw"):
        driven = track.in_direction(direction)
        start_m = draw.uniform(0.0, 5.0)
        states = list(states_on(driven, draw, 300))
        trace = trace_of(states, driven, start_m)
        rows = [row_of(state, driven, start_m) for state in states]
        assert trace.sha256 == Trace.of(rows).sha256
        assert rows_of(trace) == rows
        assert [list(map(type, row)) for row in rows_of(trace)] == [list(map(type, row)) for row in rows]


def test_no_state_is_an_empty_trace():
    track = CATALOGUE[0].geometry()
    assert trace_of([], track, 0.0).sha256 == Trace.of([]).sha256
    assert rows_of(trace_of([], track, 0.0)) == []
