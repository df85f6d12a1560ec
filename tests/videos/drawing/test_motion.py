"""Where cars are between the rows of their traces, and who leads."""

from __future__ import annotations

import numpy as np
import pytest

from paddock.simulator.trace import CRASHED
from tests.videos.drawing.runs import OVAL, STEP_S, car, driven, with_reset
from videos.drawing.motion import drive_of, follow, poses_at, read_steps
from videos.drawing.timing import standings


def steps_of(rows):
    return read_steps(car(rows).trace)


def test_a_step_places_the_middle_of_the_car_not_its_nose():
    steps = steps_of(driven(1.0, 2.0, 1.0))
    for index, metres in ((0, 1.0), (15, 3.0)):
        x, y, yaw = OVAL.point_at(metres)
        assert (steps.x[index], steps.y[index], steps.yaw[index]) == pytest.approx((x, y, yaw))
        assert steps.t[index] == pytest.approx(1000 * index * STEP_S)


def test_the_speed_shown_is_the_speed_driven():
    steps = steps_of(driven(2.0, 1.5))
    assert steps.speed == pytest.approx(1.5, abs=0.02)


def test_the_car_stays_on_its_path_between_two_rows():
    rows = driven(6.0, 3.0)
    drive = drive_of(steps_of(rows), np.arange(0.0, 6000.0, 1000 / 30))
    apart = [abs(OVAL.project(x, y).offset) for x, y in zip(drive.x, drive.y, strict=True)]
    assert max(apart) < 0.004
    assert np.hypot(np.diff(drive.x), np.diff(drive.y)) == pytest.approx(0.1, abs=0.01)


def test_headings_turn_the_short_way_round():
    steps = steps_of(driven(14.0, 2.0))
    assert np.abs(np.diff(steps.yaw)).max() < 0.3


def test_a_car_put_back_after_a_crash_does_not_glide_there():
    rows = with_reset(driven(2.0, 1.0), 10, 1.5, 1.0)
    drive = drive_of(steps_of(rows), np.arange(0.0, 1700.0, 5.0))
    places = {round(OVAL.project(x, y).distance, 2) for x, y in zip(drive.x, drive.y, strict=True)}
    crash = 10 * STEP_S
    back = (crash - 1.5) % OVAL.length
    assert all(place <= crash + 0.01 or abs(place - back) < 0.02 for place in places)
    assert set(drive.fault[drive.standing]) == {CRASHED} and set(drive.fault[~drive.standing]) == {""}
    assert drive.wait.max() == pytest.approx(1.0, abs=0.01)
    assert (np.diff(drive.wait[drive.standing]) <= 1e-9).all()
    assert not drive.speed[drive.standing].any()


def test_a_finished_car_stays_where_it_is():
    drive = drive_of(steps_of(driven(1.0)), np.array([500.0, 1500.0, 9000.0]))
    assert drive.gone.tolist() == [False, True, True]
    assert drive.x[1] == drive.x[2] and drive.speed[2] == 0.0


def test_a_bot_has_a_pose_for_each_row():
    steps = steps_of(driven(1.0))
    places = [[float(index), 0.0, 0.0] for index in range(len(steps))]
    poses = poses_at(steps, np.array([0.0, 100.0, 5000.0]), places)
    assert poses[:, 0] == pytest.approx([0.0, 1.5, len(steps) - 1])
    assert len(poses_at(steps, np.array([0.0]), [])) == 0
    assert poses_at(steps, np.array([0.0, 100.0]), [[1.0, 2.0, 0.0]]).tolist() == [[1.0, 2.0, 0.0]] * 2


def test_the_view_moves_smoothly():
    times = np.arange(0.0, 8000.0, 1000 / 30)
    eye = follow(steps_of(driven(8.0, 3.0)), times, 30, (3.9, 1.9))
    speed = np.hypot(np.diff(eye.x), np.diff(eye.y)) * 30
    assert np.abs(np.diff(speed[30:-30])).max() < 0.1  # m/s from one frame to the next
    assert (eye.zoom > 0.85).all() and (eye.zoom < 1.1).all()


def test_the_car_that_drove_farther_leads_by_a_time():
    fast, slow = steps_of(driven(4.0, 2.0)), steps_of(driven(4.0, 1.0))
    assert standings([slow, fast], 3000.0) == [(1, 0.0), (0, pytest.approx(1.5, abs=0.05))]


def test_the_earlier_finisher_leads_by_a_fixed_gap():
    early = steps_of(driven(2.0, 2.0))
    late = steps_of([row._replace(tstamp=row.tstamp * 1.25) for row in driven(2.0, 2.0)])
    for moment in (2500.0, 9000.0):
        assert standings([late, early], moment) == [(1, 0.0), (0, pytest.approx(0.5, abs=0.01))]


def test_a_car_that_never_drove_comes_last():
    assert [index for index, _ in standings([read_steps(b""), steps_of(driven(1.0))], 500.0)] == [1, 0]
