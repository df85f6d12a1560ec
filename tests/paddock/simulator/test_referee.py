"""The referee judges poses that these tests move by hand: no physics, no camera."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.rules.race import RaceRules
from paddock.simulator.car import Pose
from paddock.simulator.physics import PADDOCK_CAR, milliseconds
from paddock.simulator.progress import Reach
from paddock.simulator.referee import LAPS_DONE, RESETS_USED, Referee
from paddock.simulator.trace import IMMOBILIZED, IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, PAUSE, REVERSED, TIME_UP
from tests.soak import examples

from .tracks_for_tests import stadium

TRACK = stadium()
REACH = Reach(TRACK)
NOSE = PADDOCK_CAR.nose_x


def referee(track=TRACK, reach=REACH, start_m=0.0, **rules):
    return Referee(track, RaceRules(**rules), PADDOCK_CAR, reach if track is TRACK else None, start_m)


def on_track(distance, offset=0.0, turned=0.0, track=TRACK):
    x, y, heading = track.point_at(distance, offset)
    return Pose(x, y, heading + turned)


def drive(judge, distances, offset=0.0, turned=0.0):
    """Put the base at each distance in turn, one control step each; the statuses."""
    statuses = []
    for distance in distances:
        judge.judge(on_track(distance, offset, turned, judge.track))
        statuses.append(judge.status)
        if judge.done or judge.pause_steps:
            break
    return statuses


def steps(start, end, stride=0.2):
    count = max(1, round(abs(end - start) / stride))
    return [start + (end - start) * (i + 1) / count for i in range(count)]


# --- laps ---------------------------------------------------------------------------------------------------------


def test_a_lap_is_complete_when_the_nose_crosses_the_line():
    judge = referee(laps=1)
    drive(judge, steps(0, TRACK.length - NOSE - 0.01))
    assert judge.status == IN_PROGRESS and not judge.done
    drive(judge, [TRACK.length - NOSE + 0.01])
    assert (judge.status, judge.end_reason) == (LAP_COMPLETE, LAPS_DONE)
    assert judge.percent == 100.0


def test_lap_times_add_up_to_the_total():
    judge = referee(laps=3)
    statuses = drive(judge, steps(0, 3 * TRACK.length, 0.173))
    assert statuses.count(LAP_COMPLETE) == 3
    laps = judge.laps
    assert [lap.number for lap in laps] == [1, 2, 3]
    assert [lap.start_ms for lap in laps] == [0, laps[0].end_ms, laps[1].end_ms]
    assert sum(lap.end_ms - lap.start_ms for lap in laps) == judge.time_ms
    for lap in laps:
        assert len(lap.sector_ends_ms) == 3 and lap.sector_ends_ms[-1] == lap.end_ms
        assert lap.sector_ends_ms == sorted(lap.sector_ends_ms)


@given(stride=st.floats(0.05, 0.27))
@settings(max_examples=examples(25), deadline=None)
def test_a_crossing_is_timed_to_the_millisecond(stride):
    judge = referee(laps=2)
    drive(judge, [stride * (i + 1) for i in range(int(2 * TRACK.length / stride) + 2)])
    # At constant speed on the straight of the finish the crossing is where the nose has driven whole laps.
    for lap in judge.laps:
        exact = (lap.number * TRACK.length - NOSE) / stride
        assert lap.end_ms == pytest.approx(exact * 1000 / 15, abs=1.0)


def test_the_last_lap_ends_at_the_line_not_at_the_step():
    judge = referee(laps=1)
    drive(judge, steps(0, TRACK.length, 0.2))
    assert judge.time_ms == judge.lap.end_ms < milliseconds(judge.step)


def test_a_start_elsewhere_moves_the_finish_line():
    judge = referee(laps=1, start_m=5.0)
    drive(judge, steps(5.0, TRACK.length))
    assert not judge.done
    drive(judge, steps(TRACK.length, TRACK.length + 5.0))
    assert judge.end_reason == LAPS_DONE


# --- faults -------------------------------------------------------------------------------------------------------


def test_three_wheels_off_is_still_on_track():
    judge = referee()
    # Half a metre of road to the side; the car's wheels are 0.08 m out, so its centre may be 0.57 m out.
    assert drive(judge, [0.1], offset=0.57) == [IN_PROGRESS]
    assert not judge.all_wheels_on_track
    assert drive(judge, [0.2], offset=0.0) == [IN_PROGRESS]
    assert judge.all_wheels_on_track


def test_all_four_wheels_off_is_off_track():
    judge = referee()
    assert drive(judge, [0.1], offset=0.60) == [OFF_TRACK]
    assert judge.lap.off_tracks == 1


@pytest.mark.parametrize("side", [1, -1])
def test_a_car_is_put_back_on_the_nearer_lane(side):
    judge = referee()
    drive(judge, steps(0, 1.0), offset=0.3 * side)
    metres = judge.odometer.metres
    put_back = judge.judge(on_track(1.2, 0.62 * side))
    assert put_back.metres == pytest.approx(metres)
    x, y, heading = TRACK.lane_centre(metres, "inner" if side > 0 else "outer")
    assert tuple(put_back.pose) == pytest.approx((x, y, heading))


def test_a_penalty_is_waited_out_in_simulated_time():
    judge = referee(off_track_penalty_ms=2000)
    put_back = judge.judge(on_track(0.1, 0.7))
    at = judge.step
    judge.place(*put_back)
    statuses = []
    while judge.pause_steps:
        statuses.append(judge.wait())
    assert statuses == [PAUSE] * 29 + [IN_PROGRESS]
    assert judge.step - at == 30
    assert set(drive(judge, steps(put_back.metres, 1.0))) == {IN_PROGRESS}


def test_a_car_is_never_put_across_the_finish_line():
    judge = referee(laps=1)
    drive(judge, steps(0, TRACK.length - NOSE - 0.02))
    put_back = judge.judge(on_track(TRACK.length - NOSE - 0.01, 0.7))
    judge.place(*put_back)
    assert judge.lap.end_ms is None and judge.percent < 100
    while judge.pause_steps:
        judge.wait()
    drive(judge, steps(put_back.metres, TRACK.length))
    assert judge.end_reason == LAPS_DONE


def test_a_crossing_counts_before_off_track_in_the_same_step():
    judge = referee(laps=2)
    drive(judge, steps(0, TRACK.length - NOSE - 0.05))
    assert drive(judge, [TRACK.length - NOSE + 0.1], offset=0.65) == [LAP_COMPLETE]
    assert drive(judge, [TRACK.length], offset=0.7) == [OFF_TRACK]
    assert [lap.off_tracks for lap in judge.laps] == [0, 1]


def test_fifteen_still_steps_are_immobilised_without_penalty():
    judge = referee()
    drive(judge, steps(0, 1.0))
    statuses = drive(judge, [1.0 + 0.0002 * i for i in range(1, 30)])
    assert statuses == [IN_PROGRESS] * 14 + [IMMOBILIZED]
    assert judge.pause_steps == 1
    assert judge.lap.immobilised == 1


def test_a_crawling_car_is_not_immobilised():
    judge = referee()
    assert set(drive(judge, steps(0, 0.5, 0.01))) == {IN_PROGRESS}


def test_fifteen_backward_steps_are_reversed_fourteen_are_not():
    judge = referee()
    drive(judge, steps(0, 2.0))
    assert set(drive(judge, steps(2.0, 1.3, 0.05))) == {IN_PROGRESS}  # 14 steps
    drive(judge, [1.4])
    statuses = drive(judge, steps(1.4, 0.4, 0.05))
    assert statuses[-1] == REVERSED and len(statuses) == 15
    assert judge.pause_steps == 30


def test_without_resets_leaving_the_road_ends_the_run():
    judge = referee(max_resets=0)
    drive(judge, [0.1], offset=0.7)
    assert (judge.end_reason, judge.status) == (RESETS_USED, OFF_TRACK)
    assert judge.lap.resets == 0 and judge.lap.off_tracks == 1


def test_the_reset_budget_covers_all_laps():
    judge = referee(laps=3, max_resets=2, off_track_penalty_ms=0)
    for number in range(3):
        base = number * TRACK.length
        drive(judge, steps(base, base + TRACK.length / 2))
        put_back = judge.judge(on_track(base + TRACK.length / 2, 0.7))
        if judge.done:
            break
        judge.place(*put_back)
        judge.wait()
        drive(judge, steps(judge.odometer.metres, base + TRACK.length))
    assert judge.end_reason == RESETS_USED
    assert [lap.resets for lap in judge.laps] == [1, 1, 0]
    assert [lap.off_tracks for lap in judge.laps] == [1, 1, 1]


def test_time_may_run_out_during_a_penalty():
    judge = referee(max_simulated_ms=1000)
    put_back = judge.judge(on_track(0.1, 0.7))
    judge.place(*put_back)
    while not judge.done:
        judge.wait()
    assert (judge.end_reason, judge.status) == (TIME_UP, TIME_UP)
    assert judge.time_ms == 1000


def test_time_up_takes_precedence_over_a_lap():
    judge = referee(laps=1, max_simulated_ms=67)
    judge.odometer.put(*on_track(TRACK.length - NOSE - 0.01).ahead(NOSE), TRACK.length - 0.01)
    drive(judge, [TRACK.length])
    assert judge.end_reason == TIME_UP


def test_both_directions_are_judged_alike():
    judge = Referee(TRACK.in_direction("cw"), RaceRules(laps=1, direction="cw"), PADDOCK_CAR)
    drive(judge, steps(0, TRACK.length))
    assert judge.end_reason == LAPS_DONE
