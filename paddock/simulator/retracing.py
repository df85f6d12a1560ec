"""What a car's sensors read at every step of a run that was driven, found again from its traces.

Nothing is simulated: a trace says where the car was when it looked, the layout and the other traces what stood around
it. The readings are those that the runner drew, to the bit, but for bot cars: their places are kept to a millimetre.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from paddock.errors import PaddockError
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

from .layout import lay_out
from .physics import PADDOCK_CAR
from .sensors import Reading
from .solids import Solid, box, car
from .trace import IN_PROGRESS, LAP_COMPLETE, PREPARE

if TYPE_CHECKING:  # sensors need no physics
    from .car import Car

_ROUNDED = 0.00051  # m and rad: half of the last digit that is kept
# a car that stands out a penalty, or whose run is over, is not asked
_ASKED = (IN_PROGRESS, PREPARE, LAP_COMPLETE)


class BasePlace(NamedTuple):
    """A car's base: metres and radians."""

    x: float
    y: float
    yaw: float


class _Eyes(NamedTuple):
    """As much of a car as its sensors need."""

    pose: BasePlace


@dataclass(frozen=True)
class TracePath:
    """The steps of one car's trace. ``ms``: simulated; ``laps``: from 1; ``actions``: what was commanded, in degrees,
    m/s and the index of the list (-1 for none); ``asked``: whether its network was, at that step."""

    places: list[BasePlace]
    ms: list[int]
    laps: list[int]
    actions: list[tuple[float, float, int]]
    asked: list[bool]
    retired: bool = False

    @classmethod
    def of(cls, trace_csv: bytes, *, retired: bool = False) -> TracePath:
        """The path of a sim-trace. ``retired``: it was taken off the track while others drove on."""
        path = cls([], [], [], [], [], retired)
        rows = list(csv.DictReader(io.StringIO(trace_csv.decode())))
        for number, row in enumerate(rows):
            yaw = math.radians(float(row["yaw"]))
            # traces tell of the nose
            x = float(row["X"]) - PADDOCK_CAR.nose_x * math.cos(yaw)
            y = float(row["Y"]) - PADDOCK_CAR.nose_x * math.sin(yaw)
            path.places.append(BasePlace(x, y, yaw))
            path.ms.append(round(float(row["tstamp"]) * 1000))
            path.laps.append(int(float(row["episode"])) + 1)
            path.actions.append((float(row["steer"]), float(row["throttle"]), int(float(row["action"]))))
            path.asked.append(number + 1 < len(rows) and row["episode_status"] in _ASKED)
        return path

    def step_at(self, lap: int, ms: int) -> int | None:
        """The last step of ``lap`` at or before ``ms`` simulated milliseconds, its first one before that; None where
        there is no such lap."""
        steps = self.steps_of(lap)
        return max((step for step in steps if self.ms[step] <= ms), default=steps[0] if steps else None)

    def steps_of(self, lap: int) -> list[int]:
        """The steps of a lap, from 1."""
        return [step for step, number in enumerate(self.laps) if number == lap]

    def is_on_track(self, step: int) -> bool:
        """Whether others see it: after the row of its end it is off the track."""
        return step < len(self.places) - (0 if self.retired else 1)


@dataclass(frozen=True)
class RunSight:
    """A run as one of its cars saw it. ``boxes``: see :func:`standing_boxes`; ``bots``: for each its (x, y, yaw) at
    every step of the first car; ``others``: the other cars, in the order in which they started."""

    path: TracePath
    boxes: Sequence[Solid] = ()
    bots: Sequence[Sequence[Sequence[float]]] = ()
    others: Sequence[TracePath] = ()

    def solids(self, step: int) -> tuple[Solid, ...]:
        """What stood and drove around the car at a step, in the order of :meth:`.stage.Simulation.solids`."""
        return (
            *self.boxes,
            *(car(*places[min(step, len(places) - 1)]) for places in self.bots if places),
            *(car(*other.places[step]) for other in self.others if other.is_on_track(step)),
        )

    def readings(self, step: int, sensors: Mapping[str, Reading]) -> dict[str, np.ndarray]:
        """A reading of each of ``sensors`` (:meth:`.stage.PreparedTrack.readings`) at a step."""
        looker, solids = cast("Car", _Eyes(self.path.places[step])), self.solids(step)
        return {name: read(looker, solids) for name, read in sensors.items()}


def standing_boxes(track: TrackGeometry, rules: RaceRules, recorded: Sequence[Mapping[str, Any]]) -> tuple[Solid, ...]:
    """The boxes of a run on ``track``, in the driven direction. A result keeps their places to a millimetre
    (``recorded``); the rules say where they stood exactly, as long as this engine lays them out as that one did."""
    kept = tuple(box(each["x"], each["y"], each["yaw"]) for each in recorded)
    try:
        laid = tuple(each.solid for each in lay_out(track, rules).boxes)
    except PaddockError:
        return kept
    if len(laid) != len(kept):
        return kept
    pairs = zip(laid, kept, strict=True)
    apart = [abs(a - b) for one, other in pairs for a, b in zip(one[:3], other[:3], strict=True)]
    return laid if all(each <= _ROUNDED for each in apart) else kept
