"""Model against model: two to four cars in one world, the car behind at fault, every car timed by the same rules."""

import math

import numpy as np
import pytest

from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator.action import Action, ActionSpace
from paddock.simulator.car import Pose
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.results import metrics_json
from paddock.simulator.solids import cars_touch
from paddock.simulator.stage import PreparedTrack, Simulation
from paddock.simulator.trace import CRASHED, IN_PROGRESS, LAP_COMPLETE, PARK, PAUSE
from tests.paddock.simulator.test_race import clients
from tests.soak import some

from .tracks_for_tests import stadium

TRACK = stadium()
GROUND = PreparedTrack(TRACK)
LENGTH = TRACK.length
STRAIGHT_ON = ActionSpace.discrete([(0.0, 2.0)])
SLOWLY, FAST = Action(0.0, 0.1, None), Action(0.0, 4.0, None)


def rules_of(**rules):
    return RaceRules(race_type="head_to_head", **rules)


def pilot(speed=2.0, offset=0.0, track=TRACK, direction="ccw", wrap=lambda policy: policy):
    driver = CentreLinePilot(track, direction, speed=speed, offset=offset)
    return Entrant(driver.action_space, driver.sensors, wrap(driver))


def race(*entrants, track=TRACK, on_progress=None, **rules):
    cars = entrants
    return run_race(RaceSettings(track, rules_of(**rules), cars, on_progress=on_progress))


def failing(after, fault):
    """A wrapper for a policy: raises ``fault`` when it is asked for the ``after``-th time."""

    def wrap(policy):
        asked = 0

        def ask(readings):
            nonlocal asked
            asked += 1
            if asked == after:
                raise fault
            return policy(readings)

        return ask

    return wrap


# --- the start and the finish -----------------------------------------------------------------------------------------


def test_cars_start_75_cm_apart_in_both_lanes():
    with Simulation(GROUND, rules_of()) as stage:
        cars = [stage.add((), grid=number) for number in range(4)]
        for number, (car, lane) in enumerate(zip(cars, ["outer", "inner", "outer", "inner"], strict=True)):
            assert tuple(car.referee.pose) == pytest.approx(TRACK.lane_centre(-0.75 * number, lane))
            assert car.referee.odometer.metres == pytest.approx(0.14 - 0.75 * number, abs=0.05)
            assert car.referee.lap_start_m == 0.0


def test_all_cars_share_the_finish_line_and_starting_signal():
    result = race(pilot(2.0, -0.25), pilot(2.0, 0.25), laps=1)
    first, second = result, result.rivals[0]
    assert {first.end_reason, second.end_reason} == {"laps_done"}
    # Each crossed the line when its nose was a whole lap on, wherever it started.
    for car in (first, second):
        noses = car.trace["progress"] * LENGTH / 100
        seconds = car.trace["tstamp"]
        before = np.nonzero(noses < LENGTH)[0][-1]
        assert seconds[before] * 1000 - 1 <= car.simulated_ms <= seconds[before + 1] * 1000 + 1
        assert car.laps[0].start_ms == 0 and car.laps[0].time_ms == car.simulated_ms
    assert second.trace["progress"][0] == pytest.approx(100 * (0.14 - 0.75) / LENGTH, abs=1e-3)


def test_cars_are_ranked_by_their_finish():
    assert race(pilot(1.5, -0.25), pilot(2.5, 0.25), laps=2).order == [1, 0]
    assert race(pilot(2.5, -0.25), pilot(1.5, 0.25), laps=2).order == [0, 1]


def test_finishers_rank_first_then_distance_counts():
    result = race(pilot(0.6, -0.25), pilot(2.5, 0.25), pilot(0.9, 0.25), laps=1, max_simulated_ms=12_000)
    assert [result.end_reason, *(car.end_reason for car in result.rivals)] == ["time_up", "laps_done", "time_up"]
    assert result.order == [1, 2, 0]


def test_a_car_without_rivals_wins():
    entrant = pilot()
    assert race(entrant, laps=1).order == [0]


def test_a_world_holds_up_to_four_cars():
    with pytest.raises(ValueError, match="4 cars"):
        race(*(pilot() for _ in range(5)))


def test_a_finished_car_leaves_the_track():
    result = race(pilot(2.5, -0.25), pilot(1.0, -0.25), laps=1)
    assert result.order == [0, 1]
    assert result.rivals[0].end_reason == "laps_done"
    assert result.rivals[0].simulated_ms > 1.8 * result.simulated_ms
    assert len(result.trace) < len(result.rivals[0].trace)


# --- contacts ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def two():
    with Simulation(GROUND, rules_of(collision_penalty_ms=1000)) as stage:
        yield stage, stage.add((), grid=0), stage.add((), grid=1)


def place(car, metres, offset):
    pose = Pose(*TRACK.point_at(metres, offset))
    car.car.place(pose)
    car.referee.place(pose, metres)


def go(stage, *actions):
    stage.step(
        tuple(
            None if car.pausing or car.done else action for car, action in zip(stage.competitors, actions, strict=True)
        )
    )


@pytest.mark.parametrize("behind", [0, 1])
def test_the_car_behind_is_at_fault_and_stopped(two, behind):
    stage, *cars = two
    rear, front = cars[behind], cars[1 - behind]
    place(rear, 7.0, 0.25)
    place(front, 7.5, 0.25)
    actions = (FAST, SLOWLY) if behind == 0 else (SLOWLY, FAST)
    while rear.status != CRASHED:
        go(stage, *actions)
        assert rear.referee.step < 20
    assert (rear.referee.lap.crashes, front.referee.lap.crashes) == (1, 0)
    assert front.status == IN_PROGRESS
    at = rear.referee.pose
    for _ in range(15):
        go(stage, *actions)
        assert rear.referee.pose == at
        # The world moves on under a car that waits, which must not carry it away.
        assert math.dist(rear.car.pose[:2], at[:2]) < 1e-3
    assert not rear.pausing and rear.car.pose == pytest.approx(at, abs=1e-9)


def test_the_car_behind_is_known_across_the_finish_line(two):
    stage, first, second = two
    place(first, LENGTH - 0.15, 0.25)
    place(second, 0.1, 0.25)
    first.referee.odometer.metres -= LENGTH  # on its way to the line for the first time
    go(stage, SLOWLY, SLOWLY)
    assert (first.referee.lap.crashes, second.referee.lap.crashes) == (1, 0)


def test_a_lapped_car_ahead_still_counts_as_ahead(two):
    stage, first, second = two
    place(first, 7.2, 0.25)
    place(second, 7.5, 0.25)
    first.referee.odometer.metres += LENGTH  # a lap ahead, and right behind the other
    go(stage, SLOWLY, SLOWLY)
    assert first.status == LAP_COMPLETE  # that comes first; the crash is not forgotten
    go(stage, SLOWLY, SLOWLY)
    assert (first.referee.crashes, second.referee.crashes) == (1, 0)


def test_a_waiting_car_can_be_driven_through_without_crash(two):
    stage, first, second = two
    place(first, 7.5, 0.25)
    place(second, 6.9, 0.25)
    first.referee.pause_steps = 6
    first.status = PAUSE
    touched = 0
    for _ in range(16):
        go(stage, SLOWLY, FAST)
        touched += cars_touch(first.referee.pose, second.referee.pose)
    assert touched > 1
    assert (first.referee.crashes, second.referee.crashes) == (0, 0)


def test_one_contact_is_one_crash(two):
    stage, first, second = two
    place(first, 7.5, 0.25)
    place(second, 7.25, 0.25)
    for _ in range(60):
        go(stage, SLOWLY, SLOWLY)
    assert (first.referee.crashes, second.referee.crashes) == (0, 1)


def test_side_by_side_contact_is_nobodys_fault(two):
    stage, first, second = two
    place(first, 7.0, 0.25)
    place(second, 7.0, -0.25)
    for _ in range(15):
        go(stage, Action(0.0, 1.0, None), Action(0.0, 1.0, None))
    assert (first.referee.crashes, second.referee.crashes) == (0, 0)


def test_two_cars_are_not_put_back_onto_each_other(two):
    stage, first, second = two
    for car, metres in ((first, 7.4), (second, 7.8)):  # where they left the road is too near for both
        place(car, metres, 0.45)
        car.car.place(Pose(*TRACK.point_at(metres, 0.9)))
    go(stage, SLOWLY, SLOWLY)
    assert first.referee.lap.off_tracks == second.referee.lap.off_tracks == 1
    assert not cars_touch(first.stands_at, second.stands_at)
    go(stage, None, None)
    assert not cars_touch(first.referee.pose, second.referee.pose)


def test_each_car_sees_the_other_and_not_itself(two):
    stage, first, second = two
    (seen,) = stage.solids(first)
    assert (seen.x, seen.y, seen.yaw, seen.look) == (*second.referee.pose, "car")
    (seen,) = stage.solids(second)
    assert (seen.x, seen.y) == tuple(first.referee.pose[:2])
    second.referee.pause_steps = 5  # who waits is still seen
    assert len(stage.solids(first)) == 1
    stage.retire(second)
    assert stage.solids(first) == ()


def test_cars_do_not_push_each_other():
    alone = race(pilot(1.0, 0.25), laps=1)
    with Simulation(GROUND, rules_of(collision_penalty_ms=0)) as stage:
        first, second = stage.add((), grid=0), stage.add((), grid=1)
        place(first, 7.5, 0.25)
        place(second, 7.3, 0.25)
        for _ in range(10):
            go(stage, Action(0.0, 1.0, None), Action(0.0, 1.0, None))
        speeds = first.car.speed, second.car.speed
    assert speeds == pytest.approx((1.0, 1.0), rel=0.05)
    assert alone.end_reason == "laps_done"


# --- cars whose policy fails ------------------------------------------------------------------------------------------


def test_a_failing_rival_retires_and_the_other_drives_on():
    died = UserFault("policy_died", how="signal 9")
    result = race(pilot(2.0, -0.25), pilot(2.5, 0.25, wrap=failing(40, died)), laps=2)
    assert result.end_reason == "laps_done" and result.retired is None
    (rival,) = result.rivals
    assert rival.end_reason == "retired"
    assert rival.retired == {"code": "policy_died", "params": {"how": "signal 9"}}
    assert result.order == [0, 1]
    assert rival.trace["episode_status"][-1] == PARK and rival.trace["done"][-1]
    assert rival.laps[-1].status == "Park" and not rival.laps[-1].complete
    assert rival.steps == 39


def test_a_retired_first_car_keeps_its_laps():
    died = UserFault("policy_late", limit_s=1)
    result = race(pilot(2.0, -0.25, wrap=failing(200, died)), pilot(1.0, 0.25), laps=2)
    assert (result.end_reason, result.retired["code"]) == ("retired", "policy_late")
    assert [lap.complete for lap in result.laps] == [True, False]
    assert result.rivals[0].end_reason == "laps_done"
    assert result.order == [1, 0]


def test_all_cars_may_retire():
    died = UserFault("policy_died", how="exit 1")
    result = race(pilot(wrap=failing(5, died)), pilot(wrap=failing(3, died)), laps=1)
    assert result.end_reason == result.rivals[0].end_reason == "retired"
    assert result.order == [0, 1]


def test_a_non_finite_answer_retires_a_car():
    broken = Entrant(STRAIGHT_ON, (), lambda readings: np.float32([float("nan")]))
    result = race(pilot(2.0, -0.25), broken, laps=1)
    assert result.rivals[0].retired == {"code": "non_finite_action", "params": {"step": 1}}
    assert result.end_reason == "laps_done"


def test_a_platform_fault_propagates_and_leaves_no_world():
    before = clients()
    broken = PlatformFault("runner_died", how="exit 1")
    with pytest.raises(PlatformFault):
        race(pilot(), pilot(wrap=failing(10, broken)), laps=1)
    assert clients() == before


# --- results ----------------------------------------------------------------------------------------------------------


def test_progress_reports_include_all_cars():
    told = []
    race(pilot(2.0, -0.25), pilot(1.0, 0.25), laps=1, on_progress=told.append)
    one = told[3].to_dict()
    assert one["total_ms"] == 4000
    (rival,) = one["rivals"]
    assert set(rival) == {"lap", "percent", "total_ms", "x", "y", "off_tracks", "crashes", "retired"}
    assert 0 < rival["percent"] < one["percent"]
    assert told[-1].percent == 100.0 and told[-1].rivals[0].percent == 100.0


def test_every_car_has_its_own_metrics():
    result = race(pilot(2.0, -0.25), pilot(1.0, 0.25), laps=2)
    for car in (result, *result.rivals):
        metrics = metrics_json(car)["metrics"]
        assert [lap["elapsed_time_in_milliseconds"] for lap in metrics] == [lap.time_ms for lap in car.laps]


def test_boxes_bots_and_rivals_can_be_combined():
    result = race(pilot(2.0, -0.25), pilot(1.5, 0.25), laps=1, bots=2, bot_speed_mps=0.5)
    assert {result.end_reason, result.rivals[0].end_reason} == {"laps_done"}
    assert all(len(path) == len(result.trace) for path in result.layout["bots"])


@pytest.mark.slow
@pytest.mark.parametrize("entry", some(CATALOGUE[:7], 6), ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_four_cars_finish_on_every_catalogue_track(entry, direction):
    track = entry.geometry()
    cars = [pilot(1.2 + 0.4 * number, 0.1 * number - 0.15, track, direction) for number in range(4)]
    result = race(*cars, track=track, laps=1, direction=direction)
    assert {result.end_reason, *(car.end_reason for car in result.rivals)} == {"laps_done"}
    times = [result.simulated_ms, *(car.simulated_ms for car in result.rivals)]
    assert [times[number] for number in result.order] == sorted(times)
