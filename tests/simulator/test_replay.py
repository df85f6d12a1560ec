"""The car against drives that the official simulator recorded."""

import csv
import math
import statistics

import pytest

from evaluation.simulator.car import Pose
from evaluation.simulator.physics import PADDOCK_CAR
from evaluation.simulator.world import World
from tests.shared import SHARED, needs_shared

# Every so many of the states that can be replayed, to be quick.
TRACES = {"a-to-z-2023-evaluation": 9, "spain-2026-training-0": 1, "spain-2026-training-1": 2}
HORIZON_S = 1.0


def read(name):
    """Episodes as lists of (t, base x, base y, yaw, steer, throttle); X and Y in the file are the nose."""
    episodes = {}
    with open(SHARED / "traces" / f"{name}.csv", newline="") as file:
        for row in csv.DictReader(file):
            yaw = math.radians(float(row["yaw"]))
            nose_x, nose_y = float(row["X"]), float(row["Y"])
            x, y = Pose(nose_x, nose_y, yaw).ahead(-PADDOCK_CAR.nose_x)
            state = (float(row["tstamp"]), x, y, yaw, float(row["steer"]), float(row["throttle"]))
            episodes.setdefault(row["episode"], []).append(state)
    return list(episodes.values())


def starts(episodes, every):
    """(rows, index) where two steps lie before and the horizon behind, with no jump in between."""
    count = 0
    for rows in episodes:
        for index in range(3, len(rows)):
            if rows[-1][0] - rows[index][0] < HORIZON_S:
                break
            end = next(i for i in range(index, len(rows)) if rows[i][0] - rows[index][0] >= HORIZON_S - 0.04)
            if all(
                math.dist(a[1:3], b[1:3]) < 0.4 for a, b in zip(rows[index - 2 : end], rows[index - 1 :], strict=False)
            ):
                count += 1
                if count % every == 0:
                    yield rows, index, end


def turn(angle):
    return math.remainder(angle, 2 * math.pi)


def bicycle(rows, index, end):
    """A kinematic bicycle with the geometric wheelbase that obeys at once."""
    _, x, y, yaw, _, _ = rows[index]
    for now, after in zip(rows[index:end], rows[index + 1 : end + 1], strict=True):
        ticks = max(1, round((after[0] - now[0]) * 120))
        for _ in range(ticks):
            x += now[5] * math.cos(yaw) / 120
            y += now[5] * math.sin(yaw) / 120
            yaw += now[5] * math.tan(math.radians(now[4])) / PADDOCK_CAR.wheelbase / 120
    return Pose(x, y, yaw)


def replay(world, car, rows, index, end):
    """Drive the recorded actions from the recorded state, tick by tick because recorded steps are uneven."""
    before, start = rows[index - 1], rows[index]
    seconds = start[0] - before[0]
    speed = math.dist(before[1:3], start[1:3]) / seconds
    rate = turn(start[3] - before[3]) / seconds
    curvature = max(-2.2, min(2.2, rate / max(speed, 0.1)))
    car.start(Pose(*start[1:4]), speed=speed, wheel_angle=math.atan(curvature * PADDOCK_CAR.wheelbase), yaw_rate=rate)
    due = {round((row[0] - start[0]) * 120) + PADDOCK_CAR.dead_time_ticks: row for row in rows[index - 1 : end]}
    for tick in range(min(due), round((rows[end][0] - start[0]) * 120)):
        if tick in due:
            car.command(*due[tick][4:6])
            car.apply(0)
        if tick >= 0:
            world.advance(1)
    return car.pose


@needs_shared
@pytest.mark.parametrize("name", TRACES)
def test_the_car_drives_as_the_official_simulators_car_did(name):
    errors, turns, plain_errors, plain_turns = [], [], [], []
    with World() as world:
        car = world.add_car()
        for rows, index, end in starts(read(name), TRACES[name]):
            truth = Pose(*rows[end][1:4])
            for pose, apart, turned in (
                (replay(world, car, rows, index, end), errors, turns),
                (bicycle(rows, index, end), plain_errors, plain_turns),
            ):
                apart.append(math.dist(pose.ahead(PADDOCK_CAR.nose_x), truth.ahead(PADDOCK_CAR.nose_x)))
                turned.append(abs(math.degrees(turn(pose.yaw - truth.yaw))))
    assert len(errors) >= 15
    assert statistics.median(errors) < 0.21
    assert statistics.median(turns) < 12
    assert statistics.median(errors) < 0.6 * statistics.median(plain_errors)
    assert statistics.median(turns) < statistics.median(plain_turns)
