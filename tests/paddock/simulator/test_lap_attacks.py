"""Attempts to score a lap without driving one. None is counted, and progress never shows more than was driven.

The cars of this file are moved by hand or by a scripted driver; the referee is the one that judges races.
"""

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
from paddock.simulator.progress import Reach, clear_distance
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.referee import LAPS_DONE, RESETS_USED, Referee
from paddock.simulator.trace import IMMOBILIZED, IN_PROGRESS, OFF_TRACK, REVERSED, TIME_UP
from tests.soak import examples

from .tracks_for_tests import hairpin, stadium

NOSE = PADDOCK_CAR.nose_x
STADIUM, HAIRPIN = stadium(), hairpin()
REACH = {track: Reach(track) for track in (STADIUM, HAIRPIN)}
TRACKS = [entry for entry in CATALOGUE if not entry.is_open]


def referee(track=STADIUM, **rules):
    rules = RaceRules(**rules)
    reach = REACH.get(track) or Reach(track)
    return Referee(track, rules, PADDOCK_CAR, reach, 0.0, clear_distance(track), layout=lay_out(track, rules))


def pose_at(track, metres, offset=0.0, turned=0.0):
    x, y, heading = track.point_at(metres, offset)
    return Pose(x, y, heading + turned)


def drive(judge, start, end, offset=0.0, turned=0.0, stride=0.2):
    """Drive the base along the track from ``start`` to ``end``, obeying whatever the referee asks; the statuses."""
    statuses = []
    count = max(1, round(abs(end - start) / stride))
    for number in range(1, count + 1):
        if judge.done:
            break
        put_back = judge.judge(pose_at(judge.track, start + (end - start) * number / count, offset, turned))
        statuses.append(judge.status)
        if put_back is not None:
            judge.place(*put_back)
            while judge.pause_steps and not judge.done:
                judge.wait()
    return statuses


def no_lap(judge):
    return len(judge.laps) == 1 and judge.lap.end_ms is None


# --- oscillating over the line ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("swing", [0.1, 0.3, 0.6, 1.5])
def test_crossing_the_line_back_and_forth_scores_no_lap(swing):
    judge = referee(laps=1)
    for _ in range(30):
        drive(judge, 0.0, swing)
        drive(judge, swing, -swing)
        drive(judge, -swing, 0.0)
    assert no_lap(judge) and not judge.done
    assert judge.percent < 100 * (swing + NOSE + 0.2) / STADIUM.length


def test_crossing_back_and_forth_after_a_lap_scores_no_second():
    judge = referee(laps=3)
    end = STADIUM.length + 0.5
    drive(judge, 0.0, end)
    assert len(judge.laps) == 2
    for _ in range(30):
        drive(judge, end, end - 1.0)
        drive(judge, end - 1.0, end)
    assert len(judge.laps) == 2 and judge.lap.end_ms is None


@pytest.mark.parametrize("entry", TRACKS, ids=lambda entry: entry.name)
def test_crossing_back_and_forth_scores_no_lap_on_any_track(entry):
    judge = referee(entry.geometry(), laps=1)
    for _ in range(10):
        drive(judge, 0.0, 0.8)
        drive(judge, 0.8, -0.8)
        drive(judge, -0.8, 0.0)
    assert no_lap(judge)


# --- reversing over the line ------------------------------------------------------------------------------------------


def test_reversing_over_the_line_and_driving_on_scores_no_lap():
    judge = referee(laps=1)
    drive(judge, 0.0, -2.5, stride=0.25)
    drive(judge, -2.5, 2.5, stride=0.25)
    assert no_lap(judge)
    assert judge.percent == pytest.approx(100 * (2.5 + NOSE) / STADIUM.length, abs=0.2)


def test_a_full_lap_driven_backwards_scores_nothing():
    judge = referee(max_resets=0)
    judge.place(pose_at(STADIUM, 0.0, turned=math.pi), 0.0)
    statuses = drive(judge, 0.0, -STADIUM.length, turned=math.pi)
    assert statuses[-1] == REVERSED and len(statuses) == 15
    assert no_lap(judge)


def test_a_backward_lap_in_short_pieces_scores_nothing():
    judge = referee(laps=1)
    at = 0.0
    while at > -STADIUM.length - 1.0:  # never fifteen steps in a row, so that no reversal is judged
        drive(judge, at, at - 2.0, stride=0.2)
        drive(judge, at - 2.0, at - 1.8, stride=0.2)
        at -= 1.8
    assert no_lap(judge)
    assert judge.percent < -90


def test_reversing_over_the_line_takes_back_the_progress():
    judge = referee(laps=2)
    drive(judge, 0.0, STADIUM.length + 1.0)
    drive(judge, STADIUM.length + 1.0, STADIUM.length - 1.0)
    assert judge.lap.number == 2 and judge.percent < 0
    drive(judge, STADIUM.length - 1.0, 2 * STADIUM.length - 1.0)
    assert judge.lap.end_ms is None
    drive(judge, 2 * STADIUM.length - 1.0, 2 * STADIUM.length)
    assert judge.end_reason == LAPS_DONE


# --- cutting the infield ----------------------------------------------------------------------------------------------


def test_a_car_cutting_the_infield_is_put_back_where_it_left():
    judge = referee()
    drive(judge, 0.0, 1.0)
    left_at = judge.odometer.metres
    put_back = None
    for number in range(1, 40):  # from the lower straight across the field to the upper one
        put_back = judge.judge(Pose(1.0, -1.2 + 0.2 * number / 3, math.pi / 2))
        if put_back:
            break
    assert judge.status == OFF_TRACK
    assert put_back.metres < left_at + 0.5
    assert STADIUM.on_road(put_back.pose.x, put_back.pose.y)
    assert no_lap(judge)


def test_a_jump_along_the_road_counts_nothing():
    judge = referee(laps=1, max_resets=0)
    drive(judge, 0.0, 1.0)
    before = judge.odometer.metres
    judge.judge(pose_at(STADIUM, STADIUM.length * 0.55))  # teleported to the other straight
    assert judge.odometer.metres == before
    assert judge.status == OFF_TRACK and judge.end_reason == RESETS_USED


@pytest.mark.parametrize("resets", [0, 3])
def test_circling_over_the_infield_scores_no_lap(resets):
    """A real car that turns left for ever: over the line's straight, the field inside it, and back."""
    space = ActionSpace.discrete([(28.0, 1.5)])
    result = run_race(
        RaceSettings(
            STADIUM, RaceRules(laps=1, max_resets=resets), [Entrant(space, (), lambda readings: np.float32([1.0]))]
        )
    )
    assert result.end_reason == RESETS_USED
    assert result.laps[0].off_tracks == resets + 1 and not result.laps[0].complete


# --- another part of the track that runs alongside --------------------------------------------------------------------


def test_crossing_to_a_parallel_part_is_off_track():
    judge = referee(HAIRPIN)
    drive(judge, 0.0, 0.5)
    before = judge.odometer.metres
    sideways, pose = 0.0, judge.pose
    while judge.status == IN_PROGRESS and sideways < 0.7:
        sideways += 0.05
        pose = Pose(0.5, pose_at(HAIRPIN, 0.5).y + sideways, 0.0)
        assert any(judge.wheels(pose))  # never off the road as such: the two straights are 4 cm apart
        judge.judge(pose)
    assert judge.status == OFF_TRACK
    assert judge.odometer.metres == pytest.approx(before, abs=0.05)


def test_finishing_on_a_parallel_part_scores_no_lap():
    judge = referee(HAIRPIN, laps=1)
    drive(judge, 0.0, 2.0)
    x, y, _ = HAIRPIN.point_at(HAIRPIN.length - 2.0)
    for number in range(60):  # over to the straight back, and along it through the line
        if judge.status == OFF_TRACK or judge.done:
            break
        judge.judge(Pose(x + 0.05 * number, y, 0.0))
    assert judge.status == OFF_TRACK
    assert no_lap(judge) and judge.percent < 25


# --- standing still ---------------------------------------------------------------------------------------------------


def test_standing_still_scores_nothing():
    judge = referee(max_resets=0)
    statuses = drive(judge, 0.0, 0.0005, stride=0.0005 / 40)
    assert statuses[-1] == IMMOBILIZED
    assert no_lap(judge)


def test_standing_still_between_resets_gains_nothing():
    """A car off the track is put where its nose was; one that only stands would creep round the track like that."""
    judge = referee(laps=1, max_simulated_ms=60_000)
    while not judge.done:
        put_back = judge.judge(judge.pose)
        if put_back is not None:
            judge.place(*put_back)
            while judge.pause_steps and not judge.done:
                judge.wait()
    assert judge.end_reason == TIME_UP and judge.resets > 50
    assert no_lap(judge) and judge.odometer.metres == pytest.approx(NOSE, abs=0.01)


# --- whatever it does -------------------------------------------------------------------------------------------------


@given(moves=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.9, 0.9)), max_size=120))
@settings(max_examples=examples(60), deadline=None)
def test_progress_never_exceeds_what_the_road_allows(moves):
    judge = referee(laps=2)
    distance = 0.0
    for along, offset in moves:
        distance += along
        before = judge.odometer.metres
        if judge.pause_steps:
            break
        judge.judge(pose_at(STADIUM, distance, offset))
        assert abs(judge.odometer.metres - before) < 1.6
    assert judge.odometer.metres <= NOSE + sum(abs(along) for along, _ in moves) * 4 + 2.0


@given(
    moves=st.lists(st.tuples(st.floats(-0.27, 0.27), st.floats(-0.5, 0.5)), min_size=20, max_size=150),
    boxes=st.booleans(),
)
@settings(max_examples=examples(60), deadline=None)
def test_driving_less_than_a_lap_never_scores_one(moves, boxes):
    """Without resets progress can only come from driving: less than a lap of way along the road is no lap."""
    rules = {"race_type": "object_avoidance", "boxes": (BoxPlace(0.5, "inner"),)} if boxes else {}
    judge = referee(laps=1, max_resets=0, **rules)
    distance, way = 0.0, 0.0
    for along, offset in moves:
        if way + abs(along) > STADIUM.length - 2.0 or judge.done:
            break
        distance += along
        way += abs(along)
        judge.judge(pose_at(STADIUM, distance, offset))
    assert no_lap(judge)


# --- being put back is no way to drive --------------------------------------------------------------------------------


@pytest.mark.parametrize("slug", ["oval", "baja-turnpike"])
def test_driving_flat_out_from_reset_to_reset_is_slower(slug):
    track = next(entry.geometry() for entry in CATALOGUE if entry.slug == slug)
    rules = RaceRules(laps=1, off_track_penalty_ms=1000)  # half of the usual one
    flat_out = run_race(
        RaceSettings(track, rules, [Entrant(CentreLinePilot.action_space, (), lambda readings: np.float32([0.0, 1.0]))])
    )
    pilot = CentreLinePilot(track, speed=2.0)
    tidy = run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    assert tidy.laps[0].off_tracks == 0
    assert flat_out.laps[0].off_tracks >= 10
    assert flat_out.laps[0].time_ms > 1.5 * tidy.laps[0].time_ms
