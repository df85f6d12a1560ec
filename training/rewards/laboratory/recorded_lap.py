"""A recorded lap, its params at each point, and the rewards of a function along it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules
from paddock.simulator.action import Action
from paddock.simulator.car import Pose
from paddock.simulator.competitor import Competitor
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.rewards import Objects, reward_params
from paddock.simulator.solids import Solid
from paddock.simulator.trace import Trace

from ..sandbox.client import ask
from ..sandbox.function import Params
from ..validation import Problem

MAX_POINTS = 3000  # more is no lap that anybody looks at: 200 s of driving
_LAP_MS = 180_000
_WAVE_M = 6.0


@dataclass(frozen=True)
class Rewarded:
    """``rewards``: one a point, None where the function failed; empty if it could not start. ``problems``: without
    states. ``printed``: the beginning of the output."""

    rewards: list[float | None]
    problems: list[Problem]
    printed: str
    warnings: list[Problem] = field(default_factory=list)


class SwayingPilot(CentreLinePilot):
    """Swings from side to side about every six metres, so that most functions change on its way."""

    def __init__(self, track: TrackGeometry, direction: str, speed: float, sway_m: float) -> None:
        super().__init__(track, direction, speed)
        self._sway_m = sway_m
        self._waves = max(2, round(track.length / _WAVE_M))

    def _offset_for(self, metres: float, aim_m: float) -> float:
        return self._sway_m * math.sin(2.0 * math.pi * self._waves * aim_m / self._track.length)


def record_lap(
    track: TrackGeometry, direction: str = "ccw", *, speed_mps: float = 1.5, offset_m: float = 0.0, sway_m: float = 0.0
) -> list[Params]:
    """One lap of a scripted pilot along a line ``offset_m`` beside the centre, or weaving by ``sway_m`` to either side.

    Takes a few tenths of a second; the same every time. ``track`` as the catalogue has it.
    """
    if sway_m:
        pilot: CentreLinePilot = SwayingPilot(track, direction, speed_mps, sway_m)
    else:
        pilot = CentreLinePilot(track, direction, speed=speed_mps, offset=offset_m)
    rules = RaceRules.of_an_episode(max_simulated_ms=_LAP_MS, direction=direction)
    trace = run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)])).trace
    return params_along(track.in_direction(direction), trace.columns)


def params_along(
    track: TrackGeometry,
    columns: Trace | Mapping[str, Sequence[Any] | np.ndarray],
    *,
    solids: Sequence[Solid] = (),
    episode: int | None = None,
) -> list[Params]:
    """The params after each driven step of a sim-trace, by the code of training and, as there, without steps of a
    penalty.

    ``track`` in the driven direction; ``columns`` by the trace's names, rows in order. ``solids``: what stood on the
    track. ``episode``: only rows with this value. At most ``MAX_POINTS``. Raises KeyError for a missing column.
    """
    names = ("episode", "steps", "X", "Y", "yaw", "steer", "throttle", "all_wheels_on_track", "progress", "tstamp")
    columns = {name: np.asarray(columns[name]).tolist() for name in (*names, "episode_status")}
    objects = Objects(track)
    waypoints = [(float(x), float(y)) for x, y in track.centre]
    states: list[Params] = []
    hint: int | None = None
    for row in driven_rows(columns, episode):
        now = {name: values[row] for name, values in columns.items()}
        command = Action(columns["steer"][row - 1], columns["throttle"][row - 1], None)
        place = track.project(now["X"], now["Y"], hint)
        if abs(place.offset) > track.width_at(place.distance):  # put back elsewhere, or far from where it was
            place = track.project(now["X"], now["Y"])
        hint = place.index
        pose = Pose(*_base(now["X"], now["Y"], math.radians(now["yaw"])), math.radians(now["yaw"]))
        referee = SimpleNamespace(
            track=track,
            odometer=SimpleNamespace(place=place),
            pose=pose,
            all_wheels_on_track=bool(now["all_wheels_on_track"]),
            percent=now["progress"],
            time_ms=round(1000 * now["tstamp"]),
        )
        seen = SimpleNamespace(
            referee=referee,
            car=SimpleNamespace(physics=PADDOCK_CAR),
            action=command,
            lap_steps=now["steps"],
            status=now["episode_status"],
        )
        around = objects.params(pose, place.distance, solids)
        params = reward_params(cast(Competitor, seen), waypoints, track.direction == "cw", around)
        params["x"], params["y"] = now["X"], now["Y"]  # to the last bit, instead of there and back
        states.append(params)
    return states


def driven_rows(columns: Mapping[str, Any], episode: int | None = None) -> list[int]:
    """The rows of a trace that :func:`params_along` has params of."""
    throttle, episodes = columns["throttle"], columns["episode"]
    # a car that stands out a penalty has no command
    rows = (row for row in range(1, len(throttle)) if throttle[row - 1] > 0.0)
    return [row for row in rows if episode is None or episodes[row] == episode][:MAX_POINTS]


def rewards_along(code: str, states: Sequence[Params]) -> Rewarded:
    """The rewards at all states in order, 5 s of computing in all. Raises as
    :func:`training.rewards.validation.check_reward`."""
    answer = ask(code, states, check=True)
    problems = [Problem.of(fault) for fault, _ in answer.faults]
    return Rewarded(answer.rewards, problems, answer.printed, [Problem.of(warning) for warning in answer.warnings])


def _base(x: float, y: float, yaw: float) -> tuple[float, float]:
    return x - PADDOCK_CAR.nose_x * math.cos(yaw), y - PADDOCK_CAR.nose_x * math.sin(yaw)
