"""On every track there is: a car put back is on the road, and its progress never jumps."""

import numpy as np
import pytest

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import read_npy
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.bots import Bots, LanePaths
from paddock.simulator.car import Pose
from paddock.simulator.layout import lay_out
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.progress import Reach, clear_distance
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.referee import Referee
from paddock.simulator.solids import cars_touch
from paddock.simulator.trace import PAUSE
from tests.shared import SHARED, needs_shared
from tests.soak import some

OWN = [pytest.param(entry.geometry, id=entry.slug) for entry in CATALOGUE[:7]]
GIVEN = [
    pytest.param(lambda path=path: read_npy(path.read_bytes(), path.stem), id=path.stem, marks=[needs_shared])
    for path in sorted((SHARED / "tracks").glob("*.npy"))
] or [pytest.param(None, id="given", marks=[needs_shared])]
WITH_HAIRPINS = {"Baja Turnpike", "Baja Highway", "Kuei Raceway", "Kuei Super Raceway"}
both = pytest.mark.parametrize("direction", ["ccw", "cw"])
MANY = some([*OWN, *GIVEN], 8)


def loaded(track):
    """The track, or a skip: one of the given files is an open road."""
    try:
        return track()
    except UserFault as fault:
        pytest.skip(str(fault))


@both
@pytest.mark.parametrize("track", some(OWN, 3))
def test_a_car_leaving_at_every_bend_is_put_back_on_the_road(track, direction):
    track = track()
    rules = RaceRules(direction=direction, off_track_penalty_ms=100, max_simulated_ms=60_000)
    space = ActionSpace.discrete([(0.0, 2.0)])
    trace = run_race(RaceSettings(track, rules, [Entrant(space, (), lambda readings: np.float32([1.0]))])).trace
    paused = trace["episode_status"] == PAUSE
    assert paused.sum() > 5
    assert trace["all_wheels_on_track"][paused].all()
    gained = np.diff(trace["progress"] * track.length / 100)
    gained = gained[np.diff(trace["episode"]) == 0]
    # Metres in a step of 1/15 s; on the inside of the old tracks' hairpins, those that a stride may gain there
    reach = Reach(track.in_direction(direction))
    most = max(reach.gains) if track.name in WITH_HAIRPINS else 1.0
    assert np.abs(gained).max() <= most


@both
@pytest.mark.parametrize("apart", [1.3, pytest.param(0.13, marks=pytest.mark.soak)])
@pytest.mark.parametrize("track", MANY)
def test_a_car_is_always_put_back_on_the_road_keeping_progress(track, apart, direction):
    """``apart``: metres from one place to the next."""
    driven = loaded(track).in_direction(direction)
    rules = RaceRules(direction=direction)
    judge = Referee(driven, rules, PADDOCK_CAR, Reach(driven), 0.0, clear_distance(driven))
    for metres in np.arange(0.3, driven.length - 0.5, apart).tolist():
        for share in (-0.9, 0.0, 0.9):
            left, right = driven.half_widths_at(metres)
            pose = Pose(*driven.point_at(metres, share * (left if share > 0 else right)))
            judge.place(pose, metres)
            judge.move(pose)
            before = judge.odometer.metres
            put_back = judge._put_back(before)
            judge.place(*put_back)
            assert judge.all_wheels_on_track or any(judge.wheels(put_back.pose))
            assert driven.on_road(put_back.pose.x, put_back.pose.y)
            # The base goes where the nose was; in a bend the nose may swing a little farther.
            assert abs(judge.odometer.metres - before) < 0.5


@pytest.mark.slow
@both
@pytest.mark.parametrize(("seeds", "steps"), [(2, 300), pytest.param(20, 1200, marks=pytest.mark.soak)])
@pytest.mark.parametrize("track", MANY)
def test_boxes_and_bots_have_room_on_every_track(track, seeds, steps, direction):
    driven = loaded(track).in_direction(direction)
    for seed in range(seeds):
        rules = RaceRules(race_type="object_avoidance", random_boxes=5, seed=seed, direction=direction)
        assert len(lay_out(driven, rules).boxes) == 5
    count = 6 if driven.length > 18 else 4
    rules = RaceRules(race_type="head_to_head", bots=count, bot_speed_mps=3.0, bot_lane_changes=True, seed=2)
    bots = Bots(LanePaths(driven), rules, 15.0)
    moved = np.zeros(count)
    for _ in range(steps):
        before = bots.poses
        bots.step(())
        for number, pose in enumerate(bots.poses):
            assert not any(cars_touch(pose, other) for other in bots.poses[:number])
            moved[number] += np.hypot(pose.x - before[number].x, pose.y - before[number].y)
    assert moved.min() > 0.6 * 3.0 * steps / 15.0  # nobody is stuck behind another for long
