"""Recomputes the sensor readings at every step of a run from its traces."""

# The readings equal those of the runner to the bit, except near bots, whose positions are kept to a millimetre.

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from paddock.errors import PaddockError
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

from .layout import BoxDocument, lay_out
from .physics import PADDOCK_CAR
from .sensors import Reading
from .solids import Solid, box, car
from .trace import IN_PROGRESS, LAP_COMPLETE, PREPARE

if TYPE_CHECKING:  # sensors need no physics
    from .car import Car

_ROUNDED = 0.00051  # m and rad: half of the last digit that is kept
_DRIVING = (IN_PROGRESS, PREPARE, LAP_COMPLETE)  # the network acts: no penalty, and the run is not over


class BasePlace(NamedTuple):
    """A car's base: metres and radians."""

    x: float
    y: float
    yaw: float


class _Eyes(NamedTuple):
    """The part of a car that its sensors read."""

    pose: BasePlace


@dataclass(frozen=True)
class TracePath:
    """The steps of one car's trace. ``ms``: simulated; ``laps``: from 1; ``actions``: degrees, m/s and the index of the
    list (-1 for none); ``asked``: whether its network acted at that step; ``retired``: it left the track before the
    others."""

    places: list[BasePlace]
    ms: list[int]
    laps: list[int]
    actions: list[tuple[float, float, int]]
    asked: list[bool]
    retired: bool = False

    @classmethod
    def of(cls, trace_csv: bytes, *, retired: bool = False) -> TracePath:
        path = cls([], [], [], [], [], retired)
        rows = list(csv.DictReader(io.StringIO(trace_csv.decode())))
        for number, row in enumerate(rows):
            yaw = math.radians(float(row["yaw"]))
            # X and Y are the nose
            x = float(row["X"]) - PADDOCK_CAR.nose_x * math.cos(yaw)
            y = float(row["Y"]) - PADDOCK_CAR.nose_x * math.sin(yaw)
            path.places.append(BasePlace(x, y, yaw))
            path.ms.append(round(float(row["tstamp"]) * 1000))
            path.laps.append(int(float(row["episode"])) + 1)
            path.actions.append((float(row["steer"]), float(row["throttle"]), int(float(row["action"]))))
            path.asked.append(number + 1 < len(rows) and row["episode_status"] in _DRIVING)
        return path

    def step_at(self, lap: int, ms: int) -> int | None:
        """The last step of ``lap`` at or before ``ms`` simulated milliseconds, else its first; None without the lap."""
        steps = self.steps_of(lap)
        return max((step for step in steps if self.ms[step] <= ms), default=steps[0] if steps else None)

    def steps_of(self, lap: int) -> list[int]:
        return [step for step, number in enumerate(self.laps) if number == lap]

    def is_on_track(self, step: int) -> bool:
        """Whether other cars see it: after the row of its end it is off the track."""
        return step < len(self.places) - (0 if self.retired else 1)


@dataclass(frozen=True)
class RunSight:
    """A run as one of its cars saw it. ``boxes``: see :func:`standing_boxes`; ``bots``: as in
    :class:`.layout.LayoutDocument`; ``others``: the other cars, in the order in which they started."""

    path: TracePath
    boxes: Sequence[Solid] = ()
    bots: Sequence[Sequence[Sequence[float]]] = ()
    others: Sequence[TracePath] = ()

    def solids(self, step: int) -> tuple[Solid, ...]:
        """The blocks around the car at a step, in the order of :meth:`.stage.Simulation.solids`."""
        return (
            *self.boxes,
            *(car(*places[min(step, len(places) - 1)]) for places in self.bots if places),
            *(car(*other.places[step]) for other in self.others if other.is_on_track(step)),
        )

    def readings(self, step: int, sensors: Mapping[str, Reading]) -> dict[str, np.ndarray]:
        """A reading of each of ``sensors`` (:meth:`.stage.PreparedTrack.readings`) at a step."""
        looker, solids = cast("Car", _Eyes(self.path.places[step])), self.solids(step)
        return {name: read(looker, solids) for name, read in sensors.items()}


def standing_boxes(track: TrackGeometry, rules: RaceRules, recorded: Sequence[BoxDocument]) -> tuple[Solid, ...]:
    """The boxes of a run on ``track``, in the driven direction: at the exact places of the rules, unless another engine
    laid them out otherwise than ``recorded`` (to a millimetre)."""
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
