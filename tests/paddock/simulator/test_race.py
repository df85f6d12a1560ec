import gc

import numpy as np
import pybullet
import pytest

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.world import World

from .tracks_for_tests import stadium

TRACK = stadium()
STRAIGHT_ON = ActionSpace.discrete([(0.0, 2.0)])


def pilot_race(track=TRACK, direction="ccw", speed=2.0, offset=0.0, on_progress=None, **rules):
    pilot = CentreLinePilot(track, direction, speed=speed, offset=offset)
    rules = RaceRules(direction=direction, **rules)
    return run_race(
        RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)], on_progress=on_progress)
    )


def test_a_race_whose_readings_have_places_is_the_same():
    place = {"FRONT_FACING_CAMERA": np.zeros((120, 160, 1), np.uint8)}
    seen: list[list[bytes]] = [[], []]

    def policy(kept):
        def ask(readings):
            assert (readings is place) == (kept is seen[1])
            kept.append(readings["FRONT_FACING_CAMERA"].tobytes())
            return np.float32([1.0])

        return ask

    rules = RaceRules(max_simulated_ms=4_000)
    for kept, places in zip(seen, (None, place), strict=True):
        run_race(
            RaceSettings(TRACK, rules, [Entrant(STRAIGHT_ON, ["FRONT_FACING_CAMERA"], policy(kept), places=places)])
        )
    assert seen[0] == seen[1]
    assert len(set(seen[0])) > 10


def straight_on(readings):
    return np.float32([1.0])


# Where the scripted pilot, which brakes late, leaves the road at 3 m/s
TOO_FAST_FOR = {
    ("baja-turnpike", "ccw"),
    ("kuei-super-raceway", "ccw"),
    ("cosmic-loop", "cw"),
    ("cosmic-circuit", "cw"),
}


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_the_pilot_laps_every_catalogue_track_both_ways(entry, direction):
    track = entry.geometry()
    speed = 2.0 if (entry.slug, direction) in TOO_FAST_FOR else 3.0
    result = pilot_race(track, direction, speed=speed, laps=1)
    assert result.end_reason == "laps_done"
    assert result.laps[0].resets == 0
    assert track.length / (speed + 0.1) < result.simulated_ms / 1000 < track.length / 1.2
    progress = result.trace["progress"]
    assert np.all(np.diff(progress) < 100 * 1.0 / track.length)  # never a jump of a metre
    assert np.all(np.diff(progress) > -0.01)


def test_laps_and_sectors_add_up_to_the_millisecond():
    result = pilot_race(laps=4)
    assert [lap.number for lap in result.laps] == [1, 2, 3, 4]
    assert sum(lap.time_ms for lap in result.laps) == result.simulated_ms
    for lap, after in zip(result.laps, result.laps[1:], strict=False):
        assert after.start_ms == lap.start_ms + lap.time_ms
    for lap in result.laps:
        assert len(lap.sector_ms) == 3 and sum(lap.sector_ms) == lap.time_ms
        assert lap.complete and lap.completion_percentage == 100 and lap.status == "Lap complete"
        assert all(isinstance(value, int) for value in (lap.time_ms, *lap.sector_ms))


def test_a_straying_car_is_put_back_until_its_resets_are_used():
    result = run_race(RaceSettings(TRACK, RaceRules(max_resets=3), [Entrant(STRAIGHT_ON, (), straight_on)]))
    assert result.end_reason == "resets_used"
    assert [(lap.off_tracks, lap.resets, lap.complete, lap.status) for lap in result.laps] == [
        (4, 3, False, "Off track")
    ]
    assert 0 < result.laps[0].completion_percentage < 100


def test_without_resets_leaving_the_road_ends_the_race():
    result = run_race(RaceSettings(TRACK, RaceRules(max_resets=0), [Entrant(STRAIGHT_ON, (), straight_on)]))
    assert (result.end_reason, result.laps[0].resets, result.laps[0].off_tracks) == ("resets_used", 0, 1)


def test_the_clock_runs_while_a_car_waits_out_a_penalty():
    result = run_race(
        RaceSettings(TRACK, RaceRules(max_resets=1, off_track_penalty_ms=2000), [Entrant(STRAIGHT_ON, (), straight_on)])
    )
    trace = result.trace
    statuses = trace["episode_status"].tolist()
    fault = statuses.index("off_track")
    assert statuses[fault + 1 : fault + 30] == ["pause"] * 29
    assert statuses[fault + 30] == "in_progress"
    stood = slice(fault + 1, fault + 31)
    for column in ("X", "Y", "yaw", "progress"):
        assert len(set(trace[column][stood].tolist())) == 1
    assert trace["tstamp"][fault + 30] - trace["tstamp"][fault] == pytest.approx(2.0)
    assert trace["pause_duration"][fault + 1] == pytest.approx(29 / 15)
    assert all(trace["all_wheels_on_track"][stood])
    assert not trace["all_wheels_on_track"][fault]
    # It drives off again from standing.
    moved = np.hypot(np.diff(trace["X"]), np.diff(trace["Y"]))
    assert 0 < moved[fault + 30] < 0.08


def test_the_race_ends_when_time_is_up():
    result = pilot_race(speed=0.5, max_simulated_ms=5000)
    assert (result.end_reason, result.simulated_ms, result.steps) == ("time_up", 5000, 75)
    assert result.laps[-1].status == "Time Up" and not result.laps[-1].complete
    assert result.laps[-1].time_ms == 5000


def test_progress_is_reported_regularly_and_at_the_end():
    told = []
    result = pilot_race(laps=2, on_progress=told.append)
    assert len(told) == result.steps // 15 + (1 if result.steps % 15 else 0)
    last = told[-1]
    assert (last.lap, last.laps, last.total_ms) == (2, 2, result.simulated_ms)
    assert last.last_lap_ms == result.laps[1].time_ms
    assert told[0].lap == 1 and told[0].last_lap_ms is None and told[0].total_ms == 1000
    assert set(told[0].to_dict()) == {
        "lap",
        "laps",
        "lap_ms",
        "total_ms",
        "percent",
        "x",
        "y",
        "off_tracks",
        "crashes",
        "resets",
        "last_lap_ms",
        "bots",
        "rivals",
    }


def clients():
    """How many Bullet clients are open: a new one takes the lowest free number."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    return client


def test_a_policys_error_propagates_and_leaves_no_world():
    def dies(readings):
        raise UserFault("non_finite_action", step=1)

    before = clients()
    with pytest.raises(UserFault):
        run_race(RaceSettings(TRACK, RaceRules(), [Entrant(STRAIGHT_ON, (), dies)]))
    assert clients() == before


def test_an_unclosed_world_goes_with_its_last_reference():
    gc.collect()
    before = clients()
    world = World()
    assert clients() > before
    del world
    gc.collect()
    assert clients() == before


def test_a_non_finite_answer_names_its_step():
    answers = iter([1.0, 1.0, float("nan")])
    with pytest.raises(UserFault) as caught:
        run_race(
            RaceSettings(TRACK, RaceRules(), [Entrant(STRAIGHT_ON, (), lambda readings: np.float32([next(answers)]))])
        )
    assert caught.value.params["step"] == 3


def test_the_policy_gets_a_fresh_frame_every_step():
    seen = []

    def watch(readings):
        seen.append(readings["FRONT_FACING_CAMERA"])
        return np.float32([1.0])

    run_race(RaceSettings(TRACK, RaceRules(max_resets=0), [Entrant(STRAIGHT_ON, ["FRONT_FACING_CAMERA"], watch)]))
    assert all(frame.shape == (120, 160, 1) and frame.dtype == np.uint8 for frame in seen)
    assert len({frame.tobytes() for frame in seen}) > 10


def test_seconds_spent_are_reported_but_not_part_of_the_result():
    result = pilot_race(laps=1)
    assert set(result.seconds) == {"physics", "camera", "policy", "other"}
    assert all(value >= 0 for value in result.seconds.values())
    assert result.seconds["physics"] > 0
    again = pilot_race(laps=1)
    assert again.laps == result.laps and again.trace.sha256 == result.trace.sha256
