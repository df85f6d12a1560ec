"""Steps in which nothing happens, in C: to the last bit what competitor and referee would have come to themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator import cruise
from paddock.simulator.action import Action, ActionSpace
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.car import Pose
from paddock.simulator.competitor import Competitor
from paddock.simulator.cruise import Cruise
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.progress import Reach, clear_distance
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.randomisation import Randomisation
from paddock.simulator.referee import Referee
from paddock.simulator.trace import STATES, STATUSES
from tests.soak import only

from .tracks_for_tests import hairpin, stadium

pytestmark = pytest.mark.skipif(cruise._library is None, reason="no compiled library")
TRACK = stadium()
TRACKS = {
    "stadium": TRACK,
    "hairpin": hairpin(),  # two straights side by side
    "narrow": stadium(width=0.35),  # seldom clear of the borders
    "the other way": TRACK.in_direction("cw"),
    "tight": stadium(straight=1.6, radius=0.5, width=0.7, spacing=0.05),
}
WALKS = only([(4, 250)], [(4, 250), (200, 600)])  # how many, and their steps


class Body:
    """A car that is where a test puts it."""

    def __init__(self):
        self.pose = Pose(0.0, 0.0, 0.0)

    def place(self, pose):
        self.pose = pose


def competitor(track, reach, rules):
    referee = Referee(track, rules, PADDOCK_CAR, reach, 0.0, clear_distance(track))
    return Competitor(Body(), referee, {}, lambda _: ())


def all_of(one):
    """Everything that a competitor, its referee and its odometer say of themselves."""
    own, judge = dict(vars(one)), dict(vars(one.referee))
    for name in ("car", "referee", "_sensors", "_solids", "_states"):
        own.pop(name)
    own["rows"] = one.rows
    for name in ("track", "rules", "_physics", "odometer", "boxes", "_free"):
        judge.pop(name)
    if judge["_clear"]:  # then nobody asks
        judge.pop("_wheels_on")
    odometer = dict(vars(one.referee.odometer))
    odometer.pop("_track")
    return repr((own, judge, odometer))


def walk(rng, track):
    """Poses of a car that mostly drives on, and does all that a car can do besides."""
    along, offset = 0.0, 0.0
    while True:
        kind = rng.choice(
            ["on", "edge", "stands", "back", "jumps", "creeps", "across"], p=[0.8, 0.08, 0.03, 0.03, 0.01, 0.02, 0.03]
        )
        for _ in range(rng.integers(1, {"stands": 20, "back": 20, "jumps": 2}.get(kind, 12))):
            if kind == "jumps":
                along += rng.uniform(-3.0, 3.0)
            elif kind != "stands":
                along += {"back": -0.05, "creeps": 0.0004}.get(kind, 0.2) * rng.uniform(0.2, 1.3)
            width = track.width_at(along % track.length) / 2
            if kind in ("edge", "across"):
                offset = width * (rng.uniform(0.6, 1.1) if kind == "edge" else rng.uniform(-1.6, 1.6))
            elif kind == "on":
                offset = 0.8 * offset + rng.normal() * 0.03 * width
            x, y, heading = track.point_at(along % track.length, offset)
            yield Pose(x, y, heading if kind == "stands" else heading + rng.normal() * 0.1)


def a_step(one: Competitor, action: Action, pose: Pose) -> None:
    """A control step, seen in Python: to ``pose``, unless the car stands out a penalty."""
    if one.pausing:
        one.stand()
    else:
        one.note(action)
        one.car.pose = pose
    one.move()
    one.judge()


@pytest.mark.parametrize(("walks", "steps"), WALKS)
@pytest.mark.parametrize("track", TRACKS.values(), ids=TRACKS)
def test_a_car_that_cruises_is_where_it_would_be_without(track, walks, steps):
    reach, cruised = Reach(track), 0
    for seed in range(walks):
        rng = np.random.default_rng(seed)
        rules = RaceRules(laps=3, max_resets=20, standing_laps=bool(seed % 2), mercy_resets=3)
        seen, judged = (competitor(track, reach, rules) for _ in range(2))
        cruising = Cruise.of(seen)
        for number, pose in enumerate(walk(rng, track)):
            if judged.done or number == steps:
                break
            action = Action(float(rng.uniform(-30, 30)), float(rng.uniform(0.1, 4)), int(rng.integers(5)))
            action = action._replace(index=None) if rng.random() < 0.1 else action
            pausing = judged.pausing
            a_step(judged, action, pose)
            if cruising.on:
                assert not pausing
                seen.car.pose = pose
                cruising.step(action)
                cruised += cruising.on
            else:
                a_step(seen, action, pose)
            if rng.random() < 0.1 or judged.done:
                cruising.settle()
                assert all_of(seen) == all_of(judged), (seed, number)
            if not cruising.on:
                cruising.begin()
        cruising.settle()
        cruising.settle()  # once more is nothing
        assert all_of(seen) == all_of(judged), seed
        assert seen.trace().sha256 == judged.trace().sha256
    assert cruised > 0.3 * walks * steps / 2


@pytest.mark.parametrize("rows", [1, 3, cruise.ROWS])
def test_it_does_not_matter_how_many_steps_are_kept(rows, monkeypatch):
    expected = race(TRACK)
    monkeypatch.setattr(cruise, "ROWS", rows)
    assert race(TRACK) == expected


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_what_is_no_place_is_not_taken(wrong):
    one = competitor(TRACK, Reach(TRACK), RaceRules())
    cruising = Cruise.of(one)
    for number in range(1, 4):
        one.note(Action(0.0, 1.0, 0))
        one.referee.move(Pose(*TRACK.point_at(0.1 * number)))
        one.judge()
    cruising.begin()
    assert cruising.on
    one.car.pose = Pose(wrong, 0.0, 0.0)
    with pytest.raises(ValueError):
        cruising.step(Action(0.0, 1.0, 0))


def race(track, policy=None, *, every=15, disturbed=None, **rules):
    """All that a race tells."""
    disturbance = None if disturbed is None else disturbed.draw(np.random.default_rng(3), OFFICIAL)
    pilot = CentreLinePilot(track, track.direction, speed=2.5)
    said: list[dict] = []
    policy = policy or (pilot.action_space, pilot.sensors, pilot)
    rules = RaceRules(direction=track.direction, **rules)
    result = run_race(
        RaceSettings(
            track,
            rules,
            [Entrant(*policy)],
            on_progress=lambda progress: said.append(progress.to_dict()),
            progress_every_steps=every,
            disturbance=disturbance,
        )
    )
    laps = [lap.to_dict() for lap in result.laps]
    return result.trace.to_csv(), laps, result.end_reason, result.simulated_ms, result.steps, said


def both_ways(monkeypatch, *arguments, **options):
    """The same race with and without C; how many steps of it cruised."""
    steps: list[int] = []
    cruised = Competitor.cruised

    def counted(self, action, lap_steps, states):
        steps.append(len(states))
        cruised(self, action, lap_steps, states)

    monkeypatch.setattr(Competitor, "cruised", counted)
    quick = race(*arguments, **options)
    monkeypatch.setattr(cruise, "_library", None)
    count = sum(steps)
    assert race(*arguments, **options) == quick
    assert sum(steps) == count
    return count / quick[4]


def straight_on(readings):
    return np.float32([1.0])


STRAIGHT_ON = (ActionSpace.discrete([(0.0, 2.0)]), ["POSE"], straight_on)
WILD = ActionSpace.continuous((-30.0, 30.0), (0.5, 4.0))


def test_a_time_trial_is_the_same_and_nearly_all_of_it_cruises(monkeypatch):
    assert both_ways(monkeypatch, TRACK, laps=3) > 0.85


@pytest.mark.parametrize("every", [1, 2])
def test_progress_told_often_is_the_same(monkeypatch, every):
    assert both_ways(monkeypatch, TRACK, laps=1, every=every) == pytest.approx((every - 1) / 2, abs=0.1)


@pytest.mark.parametrize(
    "rules",
    [{"standing_laps": True, "laps": 2}, {"max_simulated_ms": 7_000}, {"start_m": 3.0}, {"off_track_penalty_ms": 0}],
    ids=str,
)
def test_other_rules_are_the_same(monkeypatch, rules):
    assert both_ways(monkeypatch, TRACK, **rules) > 0.7


def test_faults_are_the_same(monkeypatch):
    assert both_ways(monkeypatch, TRACK, STRAIGHT_ON, max_resets=3) > 0.1


@pytest.mark.parametrize("slug", ["kuei-raceway", "baja-highway"])
def test_a_wild_drive_is_the_same(monkeypatch, slug):
    track = next(entry for entry in CATALOGUE if entry.slug == slug).geometry()
    drawn = np.random.default_rng(4).uniform(-1.2, 1.2, (1500, 2)).astype(np.float32)

    def wild(readings):
        return drawn[round(abs(readings["POSE"].sum()) * 1e6) % len(drawn)]

    assert both_ways(monkeypatch, track, (WILD, ["POSE"], wild), max_simulated_ms=30_000, max_resets=20) > 0.1


def test_a_disturbed_drive_is_the_same(monkeypatch):
    assert both_ways(monkeypatch, TRACK, disturbed=Randomisation(start=0.5, latency=0.5)) > 0.7


@pytest.mark.parametrize(
    "rules", [{"race_type": "object_avoidance", "random_boxes": 2}, {"race_type": "head_to_head", "bots": 1}], ids=str
)
def test_races_with_something_on_the_road_are_judged_step_by_step(monkeypatch, rules):
    assert both_ways(monkeypatch, TRACK, laps=1, **rules) == 0.0


def test_every_status_has_room_in_a_row_of_c():
    assert [str(np.array(status, STATES["status"])) for status in STATUSES] == list(STATUSES)
