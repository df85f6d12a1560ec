"""Drives a race in this process without a sandbox, or drives it again from its traces."""

# In a process with the pins of :mod:`paddock.exact` a run has the same trace as on the site, to the bit.

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

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
from .race import Entrant, RaceSettings, run_race
from .results import CompetitorRun, Progress, RaceResult
from .sensors import policy_header
from .stage import PreparedTrack


@dataclass(frozen=True)
class OwnRun:
    """A driven race. ``ways``: for each car, its steps by the ways of :data:`paddock.network.policy_wire.WAYS`; they
    differ between processors and are no part of the result."""

    result: RaceResult
    ways: list[list[int]]

    @property
    def cars(self) -> list[CompetitorRun]:
        return [self.result, *self.result.rivals]


def drive(
    track: TrackGeometry,
    rules: RaceRules,
    cars: Sequence[OwnCar],
    look: str = OFFICIAL.name,
    on_progress: Callable[[Progress], None] | None = None,
) -> OwnRun:
    """Race ``cars`` on a track that lies in the direction of the rules; again with exact answers where the bound of a
    network did not hold.

    Raises UserFault for boxes and bots without room, and for a car alone whose network fails; Refused
    (:mod:`paddock.network.session`) for one that was not admitted.
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
    policies, entrants = [], []
    for car in cars:
        space = ActionSpace.from_metadata(car.metadata)
        facts = NetworkFacts.from_dict(car.facts)
        policy = Policy(load(car.onnx, facts), policy_header(car.metadata, space))
        sensors, lidar_config = sorted(car.metadata["sensor"]), car.metadata.get("lidar_config")
        policies.append(policy)
        entrants.append(Entrant(space, sensors, policy.answer, lidar_config))
    ground = PreparedTrack(track, rules.direction, THEMES[look])
    result = run_race(RaceSettings(track, rules, entrants, on_progress=on_progress, ground=ground))
    return OwnRun(result, [list(policy.counts.values()) for policy in policies])


@dataclass(frozen=True)
class RecordedCommands(ActionSpace):
    """An action space that ignores the network and returns the recorded command of each control step."""

    commands: tuple[Action, ...] = ()

    @classmethod
    def of_trace(cls, trace_csv: bytes) -> RecordedCommands:
        """The commands of a sim-trace of ours. Raises ValueError for anything else."""
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
        """The command of the step; after the last row the last command, so that the run comes to an end."""
        return self.commands[min(step, len(self.commands)) - 1]


def drive_again(track: TrackGeometry, rules: RaceRules, traces: Sequence[bytes]) -> RaceResult:
    """Drive the commands of these sim-traces (CSV) again, without sensors.

    Each trace is reproduced to the last bit if this engine made it; a car that retired while others drove on is not.
    Raises ValueError for anything but a trace.
    """
    cars = [Entrant(RecordedCommands.of_trace(trace), (), lambda readings: 0) for trace in traces]
    rules = replace(rules, speed_commands=())  # the traces have the speeds that were driven
    return run_race(RaceSettings(track, rules, cars))
