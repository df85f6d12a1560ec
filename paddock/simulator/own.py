"""A race driven in this very process, networks and all, as racers do at home: no sandbox, for it is their own car. And
a race driven again from the commands in its traces, where the networks are not at hand.

Started with the pins of :mod:`paddock.exact`, a run comes to the same trace as on the site, to the bit.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import EXCEEDED
from paddock.network.session import load
from paddock.packages.own import OwnCar
from paddock.rules.race import RaceRules

from .action import CONTINUOUS, Action, ActionSpace
from .camera.theme import OFFICIAL, THEMES
from .deciding import Policy
from .race import CompetitorRun, Entrant, Progress, RaceResult, run_race
from .sensors import policy_header
from .stage import PreparedTrack


@dataclass(frozen=True)
class OwnRun:
    """What a race came to. ``ways``: for each car, how many of its steps were answered in each of the ways of
    :data:`paddock.network.policy_wire.WAYS`; they differ from processor to processor and are no part of the result."""

    result: RaceResult
    ways: list[list[int]]

    @property
    def cars(self) -> list[RaceResult | CompetitorRun]:
        """The first car and its rivals, in their order."""
        return [self.result, *self.result.rivals]


def drive(
    track: TrackGeometry,
    rules: RaceRules,
    cars: Sequence[OwnCar],
    look: str = OFFICIAL.name,
    on_progress: Callable[[Progress], None] | None = None,
) -> OwnRun:
    """Race ``cars``, the first of them against the others, on a track that lies in the direction of the rules.

    As the site does it, once more with exact answers where the bound of a network did not hold. Raises UserFault for
    boxes and bots without room, and for a car alone whose network fails; Refused (:mod:`paddock.network.session`) for
    one that was not admitted.
    """
    run = _driven(track, rules, cars, look, on_progress)
    if any(ways[EXCEEDED] for ways in run.ways):
        exact = NetworkFacts(bound=None).to_dict()
        pairs = zip(cars, run.ways, strict=True)
        cars = [replace(car, facts=exact) if ways[EXCEEDED] else car for car, ways in pairs]
        run = _driven(track, rules, cars, look, on_progress)
    return run


def _driven(
    track: TrackGeometry,
    rules: RaceRules,
    cars: Sequence[OwnCar],
    look: str,
    on_progress: Callable[[Progress], None] | None,
) -> OwnRun:
    policies = [_policy(car) for car in cars]
    first, *rivals = [_entrant(car.metadata, policy) for car, policy in zip(cars, policies, strict=True)]
    result = run_race(
        track,
        rules,
        first.action_space,
        first.sensors,
        first.policy,
        on_progress=on_progress,
        rivals=rivals,
        lidar_config=first.lidar_config,
        ground=PreparedTrack(track, rules.direction, THEMES[look]),
    )
    return OwnRun(result, [list(policy.counts.values()) for policy in policies])


def _policy(car: OwnCar) -> Policy:
    header = policy_header(car.metadata, ActionSpace.from_metadata(car.metadata))
    return Policy(load(car.onnx, NetworkFacts.from_dict(car.facts)), header)


def _entrant(metadata: Mapping[str, Any], policy: Policy) -> Entrant:
    space = ActionSpace.from_metadata(metadata)
    return Entrant(space, sorted(metadata["sensor"]), policy.answer, metadata.get("lidar_config"))


@dataclass(frozen=True)
class RecordedCommands(ActionSpace):
    """An action space that answers nobody: what was commanded in each control step, row by row of a trace."""

    commands: tuple[Action, ...] = ()

    @classmethod
    def of_trace(cls, trace_csv: bytes) -> RecordedCommands:
        """Those of a sim-trace of ours. Raises ValueError for anything else."""
        try:
            rows = csv.DictReader(io.StringIO(trace_csv.decode("utf-8")))
            commands = [
                Action(
                    float(row["steer"]), float(row["throttle"]), None if row["action"] == "-1" else int(row["action"])
                )
                for row in rows
            ]
        except (KeyError, TypeError, UnicodeDecodeError, csv.Error) as error:
            raise ValueError(f"not a sim-trace: {error}") from error
        if not commands:
            raise ValueError("not a sim-trace: it has no rows")
        return cls(CONTINUOUS, commands=tuple(commands))

    def decode(self, output: np.ndarray | list[float] | int, step: int = 0) -> Action:
        """The command of the step; of a step behind the last row the last one, so that the run comes to an end."""
        return self.commands[min(step, len(self.commands)) - 1]


def drive_again(track: TrackGeometry, rules: RaceRules, traces: Sequence[bytes]) -> RaceResult:
    """The race whose cars got the commands in these sim-traces (CSV), by the same physics, referee and rules.

    No car sees anything, so this is quick. Each trace comes out again, to the last bit, if this engine made it and its
    figures are true; a car that was taken off the track while others drove on is not repeated so. Raises ValueError for
    what is no trace.
    """
    first, *rivals = [Entrant(RecordedCommands.of_trace(trace), (), _blind) for trace in traces]
    rules = replace(rules, speed_commands=())  # the traces have the speeds that were driven
    return run_race(track, rules, first.action_space, first.sensors, first.policy, rivals=rivals)


def _blind(readings: dict[str, np.ndarray]) -> np.ndarray:
    return np.zeros(2, np.float32)
