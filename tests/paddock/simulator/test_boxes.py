"""Object avoidance: what a crash into a box is, what it costs, and where the car goes on."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.car import Pose
from paddock.simulator.layout import lay_out
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.progress import Reach
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.referee import LAPS_DONE, RESETS_USED, Referee
from paddock.simulator.solids import box, hits_box, overlaps_box
from paddock.simulator.stage import PreparedTrack, Simulation
from paddock.simulator.trace import CRASHED, IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, TIME_UP
from tests.soak import examples, some

from .tracks_for_tests import stadium

TRACK = stadium()
REACH = Reach(TRACK)
LENGTH = TRACK.length
NOSE = PADDOCK_CAR.nose_x
STRAIGHT_ON = ActionSpace.discrete([(0.0, 2.0)])


def rules_of(*boxes, **rules):
    """``boxes``: (metres, lane)."""
    places = tuple(BoxPlace(metres / LENGTH, lane) for metres, lane in boxes)
    return RaceRules(race_type="object_avoidance", boxes=places, **rules)


def referee(*boxes, start_m=0.0, **rules):
    rules = rules_of(*boxes, **rules)
    return Referee(TRACK, rules, PADDOCK_CAR, REACH, start_m, layout=lay_out(TRACK, rules))


def side(lane):
    return 0.25 if lane == "inner" else -0.25


def on_track(metres, lane=None, offset=0.0):
    x, y, heading = TRACK.point_at(metres, side(lane) if lane else offset)
    return Pose(x, y, heading)


def drive(judge, start, end, lane=None, offset=0.0, stride=0.1):
    """Drive the base from ``start`` to ``end``; the PutBack of the first fault, else None."""
    count = max(1, round(abs(end - start) / stride))
    for number in range(1, count + 1):
        put_back = judge.judge(on_track(start + (end - start) * number / count, lane, offset))
        if put_back is not None or judge.done:
            return put_back
    return None


def stand(judge, put_back):
    judge.place(*put_back)
    while judge.pause_steps and not judge.done:
        judge.wait()


# --- the crash --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pose", "crashed"),
    [
        (Pose(-0.37, 0.0, 0.0), False),  # the nose 5 mm before the rectangle of 0.4 m
        (Pose(-0.36, 0.0, 0.0), True),
        (Pose(0.37, 0.0, 0.0), False),
        (Pose(0.36, 0.0, 0.0), True),
        (Pose(0.0, 0.35, 0.0), False),  # beside the rectangle of 0.5 m
        (Pose(0.0, 0.345, 0.0), True),
        (Pose(-0.36, -0.34, math.pi / 4), False),
        (Pose(-0.24, -0.33, math.pi / 4), True),  # a corner only
    ],
)
def test_a_car_corner_inside_the_40_by_50_cm_box_is_a_crash(pose, crashed):
    assert hits_box(pose, box(0.0, 0.0, 0.0)) == crashed


def test_a_box_corner_inside_the_car_is_an_overlap_but_no_crash():
    pose = Pose(-0.3044, -0.3544, math.pi / 4)  # the box's corner under the middle of the car's nose
    solid = box(0.0, 0.0, 0.0)
    assert not hits_box(pose, solid)
    assert overlaps_box(pose, solid)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), yaw=st.floats(-7, 7), turn=st.floats(-7, 7), dx=st.floats(-9, 9))
@settings(max_examples=examples(200), deadline=None)
def test_a_crash_does_not_depend_on_where_it_happens(x, y, yaw, turn, dx):
    cos, sin = math.cos(turn), math.sin(turn)
    moved = Pose(dx + x * cos - y * sin, 3.0 + x * sin + y * cos, yaw + turn)
    corners = [Pose(x, y, yaw).ahead(along * 0.16176, across * 0.09805) for along in (1, -1) for across in (1, -1)]
    margins = [max(abs(cx) - 0.2, abs(cy) - 0.25) for cx, cy in corners]
    if all(abs(margin) > 1e-6 for margin in margins):
        assert hits_box(Pose(x, y, yaw), box(0, 0, 0)) == any(margin < 0 for margin in margins)
        assert hits_box(moved, box(dx, 3.0, turn)) == any(margin < 0 for margin in margins)


def test_a_crash_costs_the_collision_penalty():
    judge = referee((8.0, "inner"), collision_penalty_ms=5000, off_track_penalty_ms=200)
    put_back = drive(judge, 0.0, 9.0, "inner")
    assert judge.status == CRASHED
    assert judge.pause_steps == 75
    assert (judge.lap.crashes, judge.lap.resets, judge.lap.off_tracks, judge.crashes) == (1, 1, 0, 1)
    assert 7.8 - 0.16176 <= judge.odometer.metres - NOSE <= 7.8 - 0.16176 + 0.1  # a step of 0.1 m
    assert put_back is not None


def test_passing_a_box_in_the_other_lane_is_no_crash():
    judge = referee((6.0, "inner"), (9.0, "outer"), laps=1)
    assert drive(judge, 0.0, 7.5, "outer") is None
    assert drive(judge, 7.5, 9.5, "inner") is None
    assert judge.status == IN_PROGRESS


def test_without_resets_a_crash_ends_the_run():
    judge = referee((6.0, "inner"), max_resets=0)
    drive(judge, 0.0, 7.0, "inner")
    assert (judge.end_reason, judge.status, judge.lap.crashes, judge.lap.resets) == (RESETS_USED, CRASHED, 1, 0)


def test_a_crash_takes_precedence_over_leaving_the_road():
    judge = referee((6.0, "outer"))
    drive(judge, 0.0, 5.5, "outer")
    x, y, heading = TRACK.point_at(5.75, -0.59)  # no wheel on the road, the left corners in the box
    judge.judge(Pose(x, y, heading))
    assert judge.status == CRASHED


# --- where the car goes on ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("lane", "other"), [("inner", "outer"), ("outer", "inner")])
def test_a_crashed_car_goes_a_metre_back_to_the_other_lane(lane, other):
    judge = referee((6.0, lane))
    put_back = drive(judge, 0.0, 7.0, lane)
    assert put_back.metres == pytest.approx(5.0)
    assert tuple(put_back.pose) == pytest.approx(TRACK.lane_centre(5.0, other))


def test_off_track_just_before_a_box_is_put_back_like_a_crash():
    judge = referee((6.0, "outer"))
    drive(judge, 0.0, 5.2, offset=0.4)
    put_back = judge.judge(on_track(5.3, offset=0.7))
    assert judge.status == OFF_TRACK
    assert tuple(put_back.pose) == pytest.approx(TRACK.lane_centre(5.0, "inner"))


def test_off_track_far_from_a_box_is_put_back_as_in_a_time_trial():
    judge = referee((6.0, "outer"))
    drive(judge, 0.0, 1.2, offset=0.4)
    put_back = judge.judge(on_track(1.3, offset=0.7))
    assert put_back.metres == pytest.approx(1.2 + NOSE)
    assert tuple(put_back.pose) == pytest.approx(TRACK.lane_centre(1.2 + NOSE, "inner"))


@pytest.mark.parametrize("beyond", [0.1, 0.4, 0.6, 0.9])
def test_a_car_is_never_put_back_before_a_passed_box(beyond):
    judge = referee((6.0, "inner"))
    drive(judge, 0.0, 6.0 + beyond, "outer")
    put_back = judge.judge(on_track(6.0 + beyond, offset=-0.75))
    assert judge.status == OFF_TRACK
    assert put_back.metres >= 6.5
    judge.place(*put_back)
    assert judge.odometer.metres >= 6.5
    assert judge.boxes.free(put_back.pose)


def test_a_car_returning_to_a_passed_box_goes_on_behind_it():
    judge = referee((6.0, "inner"))
    drive(judge, 0.0, 7.0, "outer")
    # It turns round behind the box and comes back to it, nose first.
    for number in range(1, 12):
        x, y, heading = TRACK.point_at(7.3 - 0.1 * number, 0.25)
        put_back = judge.judge(Pose(x, y, heading + math.pi))
        if put_back is not None:
            break
    assert judge.status == CRASHED
    assert put_back.metres == pytest.approx(6.5)
    assert judge.boxes.free(put_back.pose)


def test_a_box_counts_as_ahead_again_in_the_next_lap():
    judge = referee((6.0, "inner"), laps=3)
    assert drive(judge, 0.0, LENGTH + 5.0, "outer") is None
    put_back = drive(judge, LENGTH + 5.0, LENGTH + 7.0, "inner")
    assert judge.status == CRASHED and judge.lap.number == 2
    assert put_back.metres == pytest.approx(LENGTH + 5.0)
    assert [lap.crashes for lap in judge.laps] == [0, 1]


def test_between_close_boxes_a_car_goes_back_behind_the_first():
    judge = referee((6.0, "inner"), (7.2, "outer"), laps=1)
    drive(judge, 0.0, 6.1, "outer")
    put_back = drive(judge, 6.1, 8.0, "outer")
    assert judge.status == CRASHED
    assert put_back.metres == pytest.approx(6.5)  # not 6.2, which is beside the box that it has passed
    assert judge.boxes.free(put_back.pose)


def test_a_car_is_never_put_into_a_box():
    # A metre before the second box in the other lane stands the first: 5.95 m is inside it.
    judge = referee((6.0, "outer"), (7.05, "inner"), laps=1)
    drive(judge, 0.0, 5.3, "inner")
    stand(judge, judge.judge(on_track(5.35, offset=0.75)))
    assert judge.boxes.free(judge.pose)
    put_back = drive(judge, judge.odometer.metres - NOSE, 8.0, "inner")
    assert judge.status == CRASHED
    assert judge.boxes.free(put_back.pose)
    assert put_back.metres >= 6.5


def test_a_start_inside_a_box_moves_beside_or_behind_it():
    judge = referee((6.0, "inner"), start_m=6.0)
    assert judge.boxes.free(judge.pose)
    assert TRACK.on_road(judge.pose.x, judge.pose.y)
    assert judge.lap_start_m == 6.0


def test_the_third_reset_near_a_box_puts_the_car_behind_it():
    judge = referee((6.0, "inner"), laps=1)
    metres = []
    for _ in range(3):
        base = judge.odometer.metres - NOSE
        put_back = drive(judge, base, 7.5, "inner")
        metres.append(put_back.metres)
        stand(judge, put_back)
    assert metres == pytest.approx([5.0, 5.0, 7.0])
    assert drive(judge, judge.odometer.metres - NOSE, LENGTH, "inner") is None
    assert judge.end_reason == LAPS_DONE
    assert judge.lap.crashes == 3


def test_passing_a_box_clears_its_count_of_resets():
    judge = referee((6.0, "inner"), (9.0, "inner"), laps=1)
    for _ in range(2):
        stand(judge, drive(judge, judge.odometer.metres - NOSE, 7.5, "inner"))
    assert drive(judge, judge.odometer.metres - NOSE, 8.0, "outer") is None
    assert drive(judge, 8.0, 10.0, "inner").metres == pytest.approx(8.0)


def test_mercy_at_one_box_still_stops_before_the_next():
    judge = referee((6.0, "inner"), (7.5, "outer"), laps=1, mercy_resets=1)
    put_back = drive(judge, 0.0, 7.0, "inner")
    assert put_back.metres == pytest.approx(6.5)
    assert tuple(put_back.pose) == pytest.approx(TRACK.lane_centre(6.5, "inner"))


def test_without_mercy_the_same_crash_repeats_until_time_is_up():
    rules = rules_of((4.0, "outer"), mercy_resets=0, laps=1, collision_penalty_ms=1000, max_simulated_ms=30_000)
    result = run_race(RaceSettings(TRACK, rules, [Entrant(*_along(rules, offset=-0.25))]))
    assert result.end_reason == TIME_UP
    assert result.laps[0].crashes > 5
    assert np.max(result.trace["progress"]) < 100 * 4.2 / LENGTH


def test_a_car_that_cannot_avoid_boxes_still_finishes():
    rules = rules_of((4.0, "inner"), (9.0, "outer"), laps=2)
    result = run_race(RaceSettings(TRACK, rules, [Entrant(*_along(rules, offset=0.0))]))
    assert result.end_reason == LAPS_DONE
    assert [lap.crashes for lap in result.laps] == [6, 6]  # three at each box


def _along(rules, offset):
    """A pilot that knows of no boxes."""
    pilot = CentreLinePilot(TRACK, rules.direction, speed=1.5, offset=offset)
    return pilot.action_space, pilot.sensors, pilot


# --- whole races ------------------------------------------------------------------------------------------------------


def test_trace_metrics_and_layout_show_the_crash():
    rules = rules_of((4.0, "outer"), laps=1, collision_penalty_ms=3000)
    result = run_race(RaceSettings(TRACK, rules, [Entrant(*_along(rules, offset=-0.25))]))
    trace = result.trace
    statuses = trace["episode_status"].tolist()
    first = statuses.index(CRASHED)
    assert statuses[first + 1 : first + 45] == ["pause"] * 44
    counter = trace["obstacle_crash_counter"]
    assert (counter[first - 1], counter[first], counter[-1]) == (0, 1, result.laps[0].crashes)
    assert result.layout["bots"] == []
    (placed,) = result.layout["boxes"]
    assert placed["lane"] == "outer" and placed["fraction"] == pytest.approx(4.0 / LENGTH, abs=1e-6)
    assert (placed["x"], placed["y"]) == pytest.approx(TRACK.lane_centre(4.0, "outer")[:2], abs=1e-3)


def test_a_time_trial_has_an_empty_layout_and_no_solids():
    result = run_race(
        RaceSettings(TRACK, RaceRules(max_resets=0), [Entrant(STRAIGHT_ON, (), lambda readings: np.float32([1.0]))])
    )
    assert result.layout == {"boxes": [], "bots": []}
    assert (result.order, result.rivals, result.retired) == ([0], [], None)
    with Simulation(PreparedTrack(TRACK), RaceRules()) as stage:
        assert stage.solids(stage.add(())) == ()


def test_every_car_meets_the_same_boxes():
    rules = RaceRules(race_type="object_avoidance", random_boxes=4, seed=12, max_simulated_ms=3000)
    layouts = [
        run_race(RaceSettings(TRACK, rules, [Entrant(*_along(rules, offset))])).layout for offset in (-0.3, 0.0, 0.3)
    ]
    assert layouts[0] == layouts[1] == layouts[2]
    assert len(layouts[0]["boxes"]) == 4


def test_the_stage_shows_the_boxes_of_the_layout():
    rules = rules_of((4.0, "outer"), (9.0, "inner"))
    with Simulation(PreparedTrack(TRACK), rules) as stage:
        car = stage.add(())
        assert stage.solids(car) == tuple(placed.solid for placed in lay_out(TRACK, rules).boxes)


def test_a_pilot_that_sees_boxes_avoids_them():
    rules = rules_of((7.8, "inner"), (14.2, "outer"), laps=2)
    pilot = CentreLinePilot(TRACK, speed=1.5, layout=lay_out(TRACK, rules))
    result = run_race(RaceSettings(TRACK, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    assert result.end_reason == LAPS_DONE
    assert [(lap.crashes, lap.resets) for lap in result.laps] == [(0, 0), (0, 0)]


@pytest.mark.slow
@pytest.mark.parametrize("entry", some(CATALOGUE[:7], 6), ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_car_is_always_put_back_on_the_road_clear_of_boxes(entry, direction):
    track = entry.geometry()
    driven = track.in_direction(direction)
    reach, passed = Reach(driven), []
    for seed in range(4):
        rules = RaceRules(race_type="object_avoidance", random_boxes=6, seed=seed, direction=direction)
        judge = Referee(driven, rules, PADDOCK_CAR, reach, layout=lay_out(driven, rules))
        for metres in np.arange(0.3, driven.length - 0.5, 0.21).tolist():
            for offset in (-0.3, 0.0, 0.3):
                x, y, heading = driven.point_at(metres, offset)
                judge.place(Pose(x, y, heading), metres)
                judge.move(Pose(x, y, heading))
                floor = judge.boxes.floor_m
                put_back = judge._put_back(judge.odometer.metres)
                x, y, heading = put_back.pose
                assert any(judge.wheels(put_back.pose)), (metres, offset)
                assert driven.on_road(x, y)
                assert judge.boxes.free(put_back.pose), (seed, metres, offset)
                assert put_back.metres >= min(floor, put_back.metres + 1e-9)
                passed.append(floor)
    assert max(passed) > 0.8 * driven.length  # boxes were passed on the way


@pytest.mark.slow
@pytest.mark.parametrize("entry", some(CATALOGUE[:7], 3), ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_car_blind_to_boxes_finishes_every_catalogue_track(entry, direction):
    track = entry.geometry()
    driven = track.in_direction(direction)
    rules = RaceRules(race_type="object_avoidance", random_boxes=6, seed=3, laps=1, direction=direction)
    pilot = CentreLinePilot(track, direction, speed=3.0)
    result = run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    assert result.end_reason == LAPS_DONE
    progress = result.trace["progress"] * driven.length / 100
    for placed in lay_out(driven, rules).boxes:
        passed = np.nonzero(progress > placed.metres + 0.2)[0]
        assert np.all(progress[passed[0] :] >= placed.metres + 0.2 - 1e-6)
    driving = result.trace["episode_status"][:-1] == IN_PROGRESS
    driving &= result.trace["episode_status"][1:] == IN_PROGRESS
    assert np.all(np.abs(np.diff(progress))[driving] < 1.0)  # no jump while it drives


def test_a_lap_past_boxes_counts_once():
    judge = referee((6.0, "inner"), laps=2)
    assert drive(judge, 0.0, 2 * LENGTH, "outer") is None
    assert judge.status == LAP_COMPLETE and judge.end_reason == LAPS_DONE
    assert len(judge.laps) == 2


def test_a_car_hitting_a_box_with_its_rear_goes_on_behind_it():
    judge = referee((8.0, "inner"))
    assert drive(judge, 0.0, 8.1, "outer") is None  # its nose is past the box
    x, y, heading = TRACK.point_at(8.1, 0.0)
    put_back = judge.judge(Pose(x, y, heading - 0.9))  # it turns away, and its rear swings into the box
    assert judge.status == CRASHED
    assert put_back.metres == pytest.approx(8.5)
    assert judge.boxes.free(put_back.pose)
