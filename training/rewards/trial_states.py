"""The five states in which a reward function is tried, from the real referee and params code."""

import functools
import math

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import INNER, OUTER, RaceRules
from paddock.simulator.action import Action
from paddock.simulator.car import Pose
from paddock.simulator.competitor import Competitor
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.referee import Referee
from paddock.simulator.rewards import Objects, reward_params
from paddock.simulator.solids import Solid, box, car
from paddock.simulator.trace import OFF_TRACK

from .sandbox.function import Params

STATES = ("start", "valid", "progress", "off_track", "finish")  # in the order of a drive
_TRACK = "oval"
_STRIDE_M = 0.1  # of a step at 1.5 m/s
_COMMAND = Action(5.0, 1.5, None)
_VALID, _PROGRESS, _LEAVES = 0.2, 0.6, 0.4  # shares of the lap


class _PlacedCar:
    """A car at a given place; with physics the states would be harder to define."""

    physics = PADDOCK_CAR

    def __init__(self) -> None:
        self.pose = Pose(0.0, 0.0, 0.0)

    def place(self, pose: Pose) -> None:
        self.pose = pose

    def command(self, _steering_deg: float, _speed_mps: float) -> None:
        """It does not drive."""


@functools.cache
def five_states(race_type: str = "time_trial") -> tuple[Params, ...]:
    """Params of the five ``STATES``; with boxes or a bot on the track for the other race types. Not to be changed."""
    track = next(entry for entry in CATALOGUE if entry.slug == _TRACK).geometry()
    solids: list[Solid] = []
    if race_type == "object_avoidance":
        solids = [box(*track.lane_centre(share * track.length, lane)) for share, lane in ((0.3, INNER), (0.7, OUTER))]
    elif race_type == "head_to_head":
        solids = [car(*track.lane_centre(0.3 * track.length, OUTER))]
    lap = _drive(track, solids, math.inf)
    left = _drive(track, solids, _LEAVES)
    by_name = {
        "start": lap[0],
        "valid": next(state for state in lap if state["progress"] >= 100 * _VALID),
        "progress": next(state for state in lap if state["progress"] >= 100 * _PROGRESS),
        "off_track": left[-1],
        "finish": lap[-1],
    }
    return tuple(by_name[name] for name in STATES)


def _drive(track: TrackGeometry, solids: list[Solid], leaves: float) -> list[Params]:
    """The params of every step of a lap, a little left of the centre; off the road from the share ``leaves`` of the lap
    on."""
    placed = _PlacedCar()
    referee = Referee(track, RaceRules.of_an_episode(max_simulated_ms=RaceRules.max_simulated_ms), PADDOCK_CAR)
    competitor = Competitor(placed, referee, {}, lambda _: solids)  # type: ignore[arg-type]
    objects = Objects(track, 1.0)
    waypoints = [(float(x), float(y)) for x, y in track.centre]
    metres, aside, states = 0.0, 0.05, []
    while not competitor.done:
        metres += _STRIDE_M
        if metres > leaves * track.length:
            aside += _STRIDE_M / 2
        competitor.command(_COMMAND)
        placed.place(Pose(*track.point_at(metres, aside)))
        competitor.move()
        competitor.judge()
        seen = objects.params(placed.pose, referee.odometer.place.distance, solids)
        states.append(reward_params(competitor, waypoints, track.direction == "cw", seen))
        if competitor.status == OFF_TRACK:
            break
    return states
