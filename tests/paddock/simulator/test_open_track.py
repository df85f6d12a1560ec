"""Runs on a track that ends: from start to finish, and every lap from the start again."""

from __future__ import annotations

import math
from itertools import pairwise

import gymnasium
import numpy as np
import pytest

import paddock.simulator.envs
from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.camera.view import Scene
from paddock.simulator.car import Pose
from paddock.simulator.layout import BOX_SPACING_M, START_CLEAR_M, lay_out
from paddock.simulator.physics import PADDOCK_CAR, STEP_MS
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.rewards import Objects
from paddock.simulator.solids import box
from paddock.simulator.stage import PreparedTrack, Simulation

assert paddock.simulator.envs  # registers the environments
STRAIGHT = by_slug("straight-track").geometry()


def driven(direction="ccw", speed=3.0, offset=0.0, **rules):
    pilot = CentreLinePilot(STRAIGHT, direction, speed=speed, offset=offset)
    return run_race(
        RaceSettings(
            STRAIGHT, RaceRules(direction=direction, **rules), [Entrant(pilot.action_space, pilot.sensors, pilot)]
        )
    )


@pytest.fixture(scope="module")
def three_laps():
    return driven(laps=3)


def column(result, name):
    return np.asarray(result.trace.columns[name])


# --- laps -------------------------------------------------------------------------------------------------------------


def test_each_lap_begins_from_rest_at_the_start_and_takes_as_long_as_the_first(three_laps):
    assert three_laps.end_reason == "laps_done"
    times = [lap.time_ms for lap in three_laps.laps]
    assert len(times) == 3 and max(times) - min(times) <= 1  # milliseconds are rounded where the line is crossed
    assert [sum(lap.sector_ms) for lap in three_laps.laps] == times
    assert all((lap.resets, lap.off_tracks, lap.reversals) == (0, 0, 0) for lap in three_laps.laps)


def test_the_way_back_to_the_start_belongs_to_no_lap(three_laps):
    for before, after in pairwise(three_laps.laps):
        between = after.start_ms - before.start_ms - before.time_ms
        assert STEP_MS - 1 <= between <= 2 * STEP_MS
        assert after.start_ms in {math.floor(n * STEP_MS + 0.5) for n in range(500)}  # at a control step


def test_the_trace_shows_progress_from_0_to_100_in_each_lap(three_laps):
    laps, progress = column(three_laps, "episode"), column(three_laps, "progress")
    for lap in range(3):
        own = progress[laps == lap]
        assert own[0] == pytest.approx(100 * PADDOCK_CAR.nose_x / STRAIGHT.length, abs=1e-6)
        assert (np.diff(own) >= 0).all() and own[-1] == 100.0
    assert set(column(three_laps, "closest_waypoint")) == set(
        range(1, len(STRAIGHT))
    )  # the nose starts beyond the first
    assert list(column(three_laps, "episode_status")).count("lap_complete") == 3


def test_the_way_back_takes_as_long(three_laps):
    back = driven("cw", laps=1)
    assert back.laps[0].time_ms == pytest.approx(three_laps.laps[0].time_ms, abs=1)
    assert column(back, "X")[0] > column(back, "X")[-1]


def test_a_car_that_runs_out_of_time_between_two_laps_has_no_third():
    one = driven(laps=1)
    result = driven(laps=2, max_simulated_ms=round((one.steps + 1) * STEP_MS))
    assert (result.end_reason, len(result.laps)) == ("time_up", 1)
    assert result.laps[0].complete


# --- faults -----------------------------------------------------------------------------------------------------------


class Swerve:
    """Turns off the road at once, in each of its lives."""

    def __call__(self, readings):
        return np.array((1.0, 0.0), np.float32)


def test_a_car_that_leaves_the_road_is_put_back_on_it_and_never_before_the_start():
    rules = RaceRules(max_resets=3, off_track_penalty_ms=100)
    result = run_race(
        RaceSettings(STRAIGHT, rules, [Entrant(CentreLinePilot.action_space, CentreLinePilot.sensors, Swerve())])
    )
    assert (result.end_reason, result.laps[0].off_tracks) == ("resets_used", 4)
    for x, y in zip(column(result, "X"), column(result, "Y"), strict=True):
        assert STRAIGHT.project(x, y).distance > 0.0


def test_a_car_beyond_the_end_of_the_run_off_is_off_the_track():
    with Simulation(PreparedTrack(STRAIGHT), RaceRules()) as stage:
        referee = stage.add(CentreLinePilot.sensors).referee
        for metres, on_road in ((-0.3, True), (-0.8, False)):
            referee.move(Pose(*STRAIGHT.point_at(metres)))
            assert referee.all_wheels_on_track is on_road


# --- what cars see ----------------------------------------------------------------------------------------------------


def test_the_road_goes_on_a_little_and_has_a_line_at_either_end():
    ground = Scene.of(STRAIGHT).levels[0]
    to_pixel = ground.from_ground()

    def grey(metres, offset=0.08):
        x, y, _ = STRAIGHT.point_at(metres, offset)
        column, row, _ = to_pixel @ (x, y, 1.0)
        return int(ground.pixels[round(row), round(column)])

    end = STRAIGHT.length
    assert [grey(metres) for metres in (2.0, -0.3, end + 0.3)] == [OFFICIAL.road] * 3
    assert [grey(metres) for metres in (-0.04, end - 0.04, end + 0.47)] == [OFFICIAL.line] * 3
    assert [grey(metres) for metres in (-0.6, end + 0.6)] == [OFFICIAL.field] * 2


# --- boxes, bots and other cars ---------------------------------------------------------------------------------------


def test_boxes_stand_between_start_and_finish():
    for seed in range(20):
        boxes = lay_out(
            STRAIGHT, RaceRules(race_type="object_avoidance", random_boxes=3, box_distance_m=1.0, seed=seed)
        ).boxes
        metres = [box.metres for box in boxes]
        assert metres[0] >= START_CLEAR_M and metres[-1] <= STRAIGHT.length - START_CLEAR_M
        assert (np.diff(metres) >= BOX_SPACING_M).all()


@pytest.mark.parametrize("fraction", [0.1, 0.9])
def test_a_box_near_either_end_is_refused(fraction):
    with pytest.raises(UserFault) as caught:
        lay_out(STRAIGHT, RaceRules(race_type="object_avoidance", boxes=(BoxPlace(fraction, "inner"),)))
    assert caught.value.code == "box_on_start_line"


def test_a_box_is_met_in_every_lap():
    rules = {"race_type": "object_avoidance", "boxes": (BoxPlace(0.5, "inner"),), "laps": 2, "mercy_resets": 1}
    result = driven(offset=0.15, **rules)
    assert result.end_reason == "laps_done"
    assert [lap.crashes for lap in result.laps] == [1, 1]


@pytest.mark.parametrize("rules", [{"bots": 2}, {}])
def test_bots_and_races_of_several_cars_need_a_loop(rules):
    with pytest.raises(UserFault) as caught:
        lay_out(STRAIGHT, RaceRules(race_type="head_to_head", **rules))
    assert caught.value.code == "track_needs_loop"


def test_rivals_are_refused_before_anything_moves():
    pilot = CentreLinePilot(STRAIGHT)
    rival = Entrant(pilot.action_space, pilot.sensors, CentreLinePilot(STRAIGHT))
    with pytest.raises(UserFault) as caught:
        run_race(RaceSettings(STRAIGHT, RaceRules(), [Entrant(pilot.action_space, pilot.sensors, pilot), rival]))
    assert caught.value.code == "track_needs_loop"


# --- environments -----------------------------------------------------------------------------------------------------


def seen_by(steps, **options):
    """What a reward function is told in an episode of driving straight on, and the last info."""
    told = []

    def reward_function(params):
        told.append(params)
        return 1.0

    env = gymnasium.make("Paddock/TimeTrial-v1", track="straight-track", reward_function=reward_function, **options)
    env.reset(seed=1)
    last = None
    for _ in range(steps):
        *_, ended, truncated, last = env.step(5)  # straight on
        if ended or truncated:
            break
    env.close()
    return told, last


def test_an_episode_ends_with_the_road_and_its_params_do_not_wrap():
    told, info = seen_by(120, direction="cw")
    assert info["is_success"] and info["laps"][0]["complete"]
    assert told[-1]["progress"] == 100.0 and told[-1]["is_reversed"]
    assert told[-1]["closest_waypoints"] == [len(STRAIGHT) - 2, len(STRAIGHT) - 1]
    assert all(after["progress"] >= before["progress"] for before, after in pairwise(told))
    assert all(one["all_wheels_on_track"] for one in told)


@pytest.mark.parametrize(("metres", "closest"), [(0.5, [0, 0]), (2.0, [0, 1]), (5.0, [1, 1])])
def test_beyond_the_last_box_none_is_ahead(metres, closest):
    solids = [box(*STRAIGHT.lane_centre(share * STRAIGHT.length, "outer")) for share in (0.2, 0.5)]
    pose = Pose(*STRAIGHT.point_at(metres))
    assert Objects(STRAIGHT).params(pose, metres, solids)["closest_objects"] == closest


def test_random_starts_leave_room_before_the_end():
    env = gymnasium.make("Paddock/TimeTrial-v1", track="straight-track", start="random")
    starts = [env.reset(seed=seed)[1]["progress"] for seed in range(30)]
    assert 0.0 < min(starts) < 15.0 and 60.0 < max(starts) < 100 * (1 - 0.8 / STRAIGHT.length)
    with pytest.raises(ValueError, match="start_m on this open track"):
        env.reset(options={"start_m": 5.5})
    env.close()


def test_an_environment_among_bots_is_refused():
    with pytest.raises(UserFault) as caught:
        gymnasium.make("Paddock/HeadToHead-v1", track="straight-track")
    assert caught.value.code == "track_needs_loop"
