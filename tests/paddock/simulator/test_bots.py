"""Head-to-head against bots: how they drive, whom they yield to, and whose fault a crash is."""

import math
from itertools import pairwise

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator.action import Action
from paddock.simulator.bots import FOLLOW_M, Bots, LanePaths
from paddock.simulator.car import Pose
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.referee import LAPS_DONE
from paddock.simulator.solids import cars_touch
from paddock.simulator.stage import PreparedTrack, Simulation
from paddock.simulator.trace import CRASHED, IN_PROGRESS, OFF_TRACK, PAUSE

from .tracks_for_tests import stadium

TRACK = stadium()
GROUND = PreparedTrack(TRACK)
LENGTH = TRACK.length
HZ = 15.0
STILL = Action(0.0, 0.1, None)


def rules_of(bots=1, speed=1.0, **rules):
    return RaceRules(race_type="head_to_head", bots=bots, bot_speed_mps=speed, **rules)


def bots_of(bots=1, speed=1.0, **rules):
    return Bots(GROUND.lanes, rules_of(bots, speed, **rules), HZ)


def drive(bots, steps, cars=()):
    """Poses of all bots after each step, (steps, bots) of Pose."""
    poses = []
    for _ in range(steps):
        bots.step(cars)
        poses.append(bots.poses)
    return poses


def put(bot, metres, lane, bots):
    bot.metres, bot.lane, bot.before = metres % LENGTH, lane, None
    bots._pose(bot)


# --- driving ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [0.2, 1.0, 4.0])
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_bot_follows_its_lane_at_its_ground_speed(speed, direction):
    track = TRACK.in_direction(direction)
    bots = Bots(LanePaths(track), rules_of(1, speed), HZ)
    (bot,) = bots.bots
    lane = bot.lane
    before = bot.pose
    for _ in range(300):
        bots.step(())
        x, y, heading = track.lane_centre(bot.metres, lane)
        assert math.hypot(bot.pose.x - x, bot.pose.y - y) < 0.005
        assert abs(math.remainder(bot.pose.yaw - heading, 2 * math.pi)) < 0.03
        assert math.hypot(bot.pose.x - before.x, bot.pose.y - before.y) == pytest.approx(speed / HZ, rel=0.01)
        before = bot.pose


def test_a_lap_on_the_inner_lane_is_shorter():
    laps = {}
    for lane in ("inner", "outer"):
        bots = bots_of(1, 1.0)
        put(bots.bots[0], 1.0, lane, bots)
        steps, before = 0, 1.0
        while steps < 10 or not before < 1.0 <= bots.bots[0].metres:
            before = bots.bots[0].metres
            bots.step(())
            steps += 1
        laps[lane] = steps / HZ
    # Two straights of 4 m and a circle of radius 1.2 m less or more a quarter of the width.
    assert laps["inner"] == pytest.approx(8 + 2 * math.pi * 0.95, rel=0.02)
    assert laps["outer"] == pytest.approx(8 + 2 * math.pi * 1.45, rel=0.02)


def test_bots_start_apart_on_both_lanes_and_off_the_grid():
    bots = bots_of(4).bots
    assert [bot.lane for bot in bots] in (["inner", "outer"] * 2, ["outer", "inner"] * 2)
    assert all(2.5 <= bot.metres <= LENGTH - 2.5 for bot in bots)
    assert min(b.metres - a.metres for a, b in pairwise(bots)) >= 2.0


def test_the_seed_decides_the_lanes():
    assert len({tuple(bot.lane for bot in bots_of(2, seed=seed).bots) for seed in range(20)}) == 2


def test_without_lane_changes_bots_keep_their_lanes():
    bots = bots_of(3, 2.0)
    lanes = [bot.lane for bot in bots.bots]
    for _ in range(600):
        bots.step(())
        assert [bot.lane for bot in bots.bots] == lanes
        assert all(abs(abs(bot.offset) - 0.25) < 0.01 for bot in bots.bots)


def test_bots_change_lanes_over_a_metre_at_seeded_intervals():
    bots = bots_of(1, 1.5, bot_lane_changes=True, bot_lane_change_least_ms=3000, bot_lane_change_most_ms=5000, seed=4)
    (bot,) = bots.bots
    begun, ended, offsets = [], [], []
    for step in range(1500):
        before = bot.before
        bots.step(())
        offsets.append(bot.offset)
        if before is None and bot.before is not None:
            begun.append(step)
        if before is not None and bot.before is None:
            ended.append(step)
    assert len(begun) > 15
    assert max(np.abs(np.diff(offsets))) < 0.11  # no jump: at most a slope of 0.75 over 0.1 m
    for start, end in zip(begun, ended, strict=False):
        assert (end - start) * 1.5 / HZ == pytest.approx(1.0, abs=0.35)  # in the other lane after a metre
    waits = [(start - end) / HZ for end, start in zip(ended, begun[1:], strict=False)]
    assert min(waits) >= 3.0 and max(waits) <= 5.1
    assert max(waits) - min(waits) > 0.5


def test_the_heading_follows_the_path_of_a_lane_change():
    bots = bots_of(1, 1.0, bot_lane_changes=True, bot_lane_change_least_ms=1, bot_lane_change_most_ms=1)
    (bot,) = bots.bots
    before, turned = bot.pose, 0.0
    for _ in range(30):
        bots.step(())
        way = math.atan2(bot.pose.y - before.y, bot.pose.x - before.x)
        assert abs(math.remainder(way - bot.pose.yaw, 2 * math.pi)) < 0.25
        turned = max(turned, abs(math.remainder(bot.pose.yaw - TRACK.point_at(bot.metres)[2], 2 * math.pi)))
        before = bot.pose
    assert 0.4 < turned < 0.8


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_six_bots_stay_apart_on_every_catalogue_track(entry, direction):
    track = entry.geometry().in_direction(direction)
    bots = Bots(LanePaths(track), rules_of(6, 2.0, bot_lane_changes=True, seed=9), HZ)
    for step in range(900):
        bots.step(())
        poses = bots.poses
        if step % 5 == 0:
            assert all(track.on_road(pose.x, pose.y) for pose in poses)
        for number, pose in enumerate(poses):
            assert not any(cars_touch(pose, other) for other in poses[:number])


# --- yielding ---------------------------------------------------------------------------------------------------------


def test_a_bot_stops_behind_a_standing_car_in_its_lane():
    bots = bots_of(1, 4.0)
    (bot,) = bots.bots
    put(bot, 3.0, "inner", bots)
    drive(bots, 30, [(8.0, 0.25)])
    assert bot.metres == pytest.approx(8.0 - FOLLOW_M, abs=0.01)
    drive(bots, 3, [(8.0, -0.25)])  # it moved over to the other lane
    assert bot.metres > 8.0 - FOLLOW_M + 0.7


def test_a_bot_follows_a_slower_car_at_a_distance():
    bots = bots_of(1, 2.0)
    (bot,) = bots.bots
    put(bot, 1.0, "outer", bots)
    metres = 3.0
    for _ in range(200):
        metres += 0.5 / HZ
        bots.step([(metres % LENGTH, -0.25)])
        assert (metres - bot.metres) % LENGTH > 0.25
    assert (metres - bot.metres) % LENGTH < 0.7


@pytest.mark.parametrize("offset", [-0.25, 0.25])
def test_a_bot_passes_a_car_in_the_other_lane(offset):
    bots = bots_of(1, 2.0)
    put(bots.bots[0], 6.0, "inner" if offset < 0 else "outer", bots)
    drive(bots, 30, [(8.0, offset)])
    assert bots.bots[0].metres == pytest.approx(10.0, abs=0.2)


def test_a_bot_does_not_change_into_an_occupied_lane():
    bots = bots_of(1, 1.0, bot_lane_changes=True, bot_lane_change_least_ms=1, bot_lane_change_most_ms=1)
    (bot,) = bots.bots
    put(bot, 6.5, "inner", bots)
    for beside in (-1.4, 0.0, 1.4):
        for _ in range(10):
            bots.step([((bot.metres + beside) % LENGTH, -0.25)])
            assert bot.lane == "inner" and bot.before is None
    bots.step([((bot.metres + 1.7) % LENGTH, -0.25)])
    assert bot.lane == "outer"


def test_bots_do_not_run_into_a_pausing_bot():
    bots = bots_of(2, 2.0, bot_pause_ms=3000)
    first, second = bots.bots
    put(first, 8.0, "inner", bots)
    put(second, 6.0, "inner", bots)
    bots.pause(first)
    drive(bots, 44)
    assert first.metres == 8.0
    assert second.metres == pytest.approx(8.0 - FOLLOW_M, abs=0.02)
    drive(bots, 15)
    assert first.metres > 9.5


# --- crashes ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def stage():
    with Simulation(GROUND, rules_of(1, 1.0, collision_penalty_ms=1000, bot_pause_ms=2000)) as stage:
        yield stage


def place(stage, car, bot_m, lane, car_m, offset):
    """Put the only bot and the car somewhere, both standing."""
    put(stage.bots.bots[0], bot_m, lane, stage.bots)
    pose = Pose(*TRACK.point_at(car_m, offset))
    car.car.place(pose)
    car.referee.place(pose, car_m)


def test_hitting_a_bot_stops_the_car_and_pauses_the_bot(stage):
    car = stage.add(())
    place(stage, car, 8.0, "inner", 7.5, 0.25)
    while car.status != CRASHED:
        stage.step((Action(0.0, 4.0, None),))
        assert car.referee.step < 20
    crashed_at, bot_at = car.referee.pose, stage.bots.poses
    assert (car.referee.lap.crashes, car.referee.lap.resets, car.referee.pause_steps) == (1, 1, 15)
    for _ in range(15):
        stage.step((None,))
        assert car.referee.pose == crashed_at
        assert stage.bots.poses == bot_at
    assert car.status == IN_PROGRESS
    # Let go while the two still touch: no second crash until they have been clear of each other.
    assert cars_touch(car.referee.pose, stage.bots.poses[0])
    for _ in range(12):
        stage.step((STILL,))
    assert car.referee.lap.crashes == 1


def test_a_contact_after_separation_counts_again(stage):
    car = stage.add(())
    place(stage, car, 8.0, "inner", 7.5, 0.25)
    while car.status != CRASHED:
        stage.step((Action(0.0, 4.0, None),))
    for _ in range(60):
        stage.step((None if car.pausing else STILL,))
    assert not cars_touch(car.referee.pose, stage.bots.poses[0])
    place(stage, car, 9.0, "inner", 8.9, 0.25)
    stage.step((STILL,))
    assert car.status == CRASHED and car.referee.lap.crashes == 2


def test_a_bot_hitting_the_car_from_behind_pauses_alone(stage):
    car = stage.add(())
    place(stage, car, 7.8, "inner", 8.05, 0.25)
    stage.step((STILL,))
    assert cars_touch(car.referee.pose, stage.bots.poses[0])
    assert (car.status, car.referee.lap.crashes) == (IN_PROGRESS, 0)
    at = stage.bots.poses
    for _ in range(20):
        stage.step((Action(0.0, 2.0, None),))
        assert stage.bots.poses == at
    assert car.referee.lap.crashes == 0
    for _ in range(15):
        stage.step((STILL,))
    assert stage.bots.poses != at


def test_the_car_behind_is_known_across_the_finish_line(stage):
    car = stage.add(())
    place(stage, car, LENGTH - 0.15, "inner", 0.1, 0.25)  # the bot behind the line, the car before it
    stage.step((STILL,))
    assert cars_touch(car.referee.pose, stage.bots.poses[0])
    assert car.referee.lap.crashes == 0
    assert stage.bots.bots[0].pause_steps == 30


def test_bots_pass_through_a_car_waiting_out_a_penalty(stage):
    car = stage.add(())
    place(stage, car, 6.5, "inner", 7.2, 0.25)
    car.referee.pause_steps = 60
    car.referee.status = PAUSE
    touched = False
    for _ in range(45):
        stage.step((None,))
        touched |= cars_touch(car.referee.pose, stage.bots.poses[0])
    assert touched
    assert stage.bots.bots[0].metres > 8.5
    assert car.referee.lap.crashes == 0


def test_a_car_is_not_put_back_onto_a_bot(stage):
    car = stage.add(())
    place(stage, car, 7.6, "inner", 7.5, 0.45)
    pose = Pose(*TRACK.point_at(7.5, 0.8))
    car.referee.place(pose, 7.5)
    put_back = car.referee._put_back(7.6)
    assert not cars_touch(put_back.pose, stage.bots.poses[0])
    assert TRACK.on_road(put_back.pose.x, put_back.pose.y)


# --- whole races ------------------------------------------------------------------------------------------------------


def pilot_race(track=TRACK, speed=2.0, offset=0.0, **rules):
    rules = rules_of(**rules)
    pilot = CentreLinePilot(track, rules.direction, speed=speed, offset=offset)
    told = []
    result = run_race(
        RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)], on_progress=told.append)
    )
    return result, told


def test_bots_have_a_pose_for_every_row_of_the_trace():
    result, told = pilot_race(bots=3, speed=2.0, offset=0.25, laps=2, bot_lane_changes=True)
    assert result.end_reason == LAPS_DONE
    bots = result.layout["bots"]
    assert len(bots) == 3 and all(len(path) == len(result.trace) for path in bots)
    assert all(len(place) == 3 and round(place[0], 3) == place[0] for path in bots for place in path)
    steps = np.linalg.norm(np.diff(np.array(bots)[:, :, :2], axis=1), axis=2)
    assert steps.max() < 1.1 / HZ and np.median(steps) == pytest.approx(1.0 / HZ, rel=0.05)
    assert len(told[0].bots) == 3
    assert told[0].bots[0] == tuple(bots[0][15][:2])


def test_bots_drive_on_while_the_car_waits_out_a_penalty(stage):
    car = stage.add(())
    place(stage, car, 10.0, "inner", 3.0, 0.8)
    stage.step((STILL,))
    assert car.status == OFF_TRACK
    for _ in range(29):
        before = stage.bots.poses[0]
        stage.step((None,))
        after = stage.bots.poses[0]
        assert car.status == PAUSE
        assert math.dist(before[:2], after[:2]) == pytest.approx(1.0 / HZ, rel=0.01)


def test_passing_bots_cleanly_costs_nothing():
    result, _ = pilot_race(stadium(width=1.6), bots=2, speed=1.0, offset=0.0, laps=3)  # between the two lanes
    assert result.end_reason == LAPS_DONE
    assert [lap.crashes for lap in result.laps] == [0, 0, 0]


def test_the_stage_shows_bots_at_their_poses():
    with Simulation(GROUND, rules_of(2, 1.0)) as stage:
        car = stage.add(())
        before = stage.solids(car)
        stage.step((STILL,))
        after = stage.solids(car)
        assert [(solid.x, solid.y, solid.yaw) for solid in after] == [tuple(pose) for pose in stage.bots.poses]
        assert before != after and {solid.look for solid in after} == {"car"}
        stage.clear()
        assert stage.solids(stage.add(())) == before


def test_a_short_lane_change_is_over_sooner():
    def changing(metres: float) -> int:
        bots = bots_of(
            1,
            1.0,
            bot_lane_changes=True,
            bot_lane_change_least_ms=1,
            bot_lane_change_most_ms=1,
            bot_lane_change_m=metres,
        )
        steps = 0
        for _ in range(90):
            bots.step(())
            if bots.bots[0].before is not None:
                steps += 1
            elif steps:
                break
        return steps

    assert changing(0.5) < changing(1.0) < changing(3.0)


def test_rules_that_came_later_are_told_only_where_they_are_set():
    usual = RaceRules(race_type="head_to_head", bots=1)
    assert not {"bot_lane_change_m", "duel_gap_m"} & usual.to_dict().keys()
    other = RaceRules(race_type="head_to_head", bots=1, bot_lane_change_m=2.0, duel_gap_m=1.5)
    assert RaceRules.from_dict(other.to_dict()) == other
    with pytest.raises(ValueError, match="bot_lane_change_m"):
        RaceRules(race_type="head_to_head", bots=1, bot_lane_change_m=0.1)
