"""The golden runs: short ones of all race types, sensors and action spaces."""

import functools
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

from paddock.geometry.catalogue import by_slug
from paddock.geometry.files import read_npy
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, INNER, OBJECT_AVOIDANCE, OUTER, TIME_TRIAL, BoxPlace, RaceRules

CONSOLE = "console"  # the car that the old console trained: only where somebody has its archive


class GoldenRunDocument(TypedDict):
    """A :class:`GoldenRun` in JSON."""

    name: str
    track: str
    rules: dict[str, object]
    cars: list[str]


@dataclass(frozen=True)
class GoldenRun:
    """One run. ``track``: a slug of the catalogue, or the path of a ``.npy`` file; ``cars``: names that
    :func:`.cars.car` knows, the first on the grid first."""

    name: str
    track: str
    rules: RaceRules
    cars: tuple[str, ...]

    def geometry(self) -> TrackGeometry:
        return _track(self.track).in_direction(self.rules.direction)

    def with_cars(self, paths: Mapping[str, str]) -> "GoldenRun":
        """The same run with cars at these paths."""
        return replace(self, cars=tuple(paths.get(name, name) for name in self.cars))

    def shortened(self, simulated_ms: int) -> "GoldenRun":
        rules = replace(self.rules, max_simulated_ms=min(simulated_ms, self.rules.max_simulated_ms))
        return replace(self, rules=rules)

    def to_dict(self) -> GoldenRunDocument:
        return {"name": self.name, "track": self.track, "rules": self.rules.to_dict(), "cars": list(self.cars)}

    @classmethod
    def from_dict(cls, data: GoldenRunDocument) -> "GoldenRun":
        """The inverse of :meth:`to_dict`, also after JSON."""
        return cls(data["name"], data["track"], RaceRules.from_dict(data["rules"]), tuple(data["cars"]))


@functools.cache
def _track(track: str) -> TrackGeometry:
    path = Path(track)
    return read_npy(path.read_bytes(), path.stem) if path.suffix == ".npy" else by_slug(track).geometry()


def _run(name: str, track: str, *cars: str, seconds: float, **rules: Any) -> GoldenRun:
    return GoldenRun(name, track, RaceRules(max_simulated_ms=round(seconds * 1000), **rules), cars)


_PLACES = (BoxPlace(0.14, INNER), BoxPlace(0.24, OUTER), BoxPlace(0.34, INNER))

RUNS: tuple[GoldenRun, ...] = (
    _run("a lap by continuous actions", "oval", "flyer", seconds=8, laps=1),
    _run("a table of actions, clockwise", "cosmic-circuit", "steady", seconds=5, direction="cw"),
    _run("hairpins at speed", "baja-turnpike", "flyer", seconds=6, direction="cw"),
    _run("boxes in fixed places", "oval", "brisk", seconds=6, race_type=OBJECT_AVOIDANCE, boxes=_PLACES),
    _run(
        "boxes in drawn places, met with a lidar",
        "kuei-raceway",
        "steps",
        seconds=6,
        race_type=OBJECT_AVOIDANCE,
        random_boxes=6,
        seed=3,
        collision_penalty_ms=1000,
    ),
    _run(
        "bots that change lanes",
        "kuei-super-raceway",
        "brisk",
        seconds=6,
        race_type=HEAD_TO_HEAD,
        bots=4,
        bot_lane_changes=True,
        bot_lane_change_least_ms=1000,
        bot_lane_change_most_ms=2000,
        seed=5,
        direction="cw",
    ),
    _run(
        "bots met with a lidar of sectors",
        "baja-highway",
        "sectors",
        seconds=5,
        race_type=HEAD_TO_HEAD,
        bots=6,
        bot_speed_mps=0.4,
        seed=1,
        collision_penalty_ms=1000,
    ),
    _run("a duel", "cosmic-loop", "brisk", "flyer", seconds=5, race_type=HEAD_TO_HEAD),
    _run("two eyes", "kuei-raceway", "both-eyes", seconds=5, race_type=TIME_TRIAL),
    _run(
        "camera and lidar among boxes",
        "cosmic-loop",
        "beams",
        seconds=5,
        race_type=OBJECT_AVOIDANCE,
        random_boxes=4,
        seed=8,
        direction="cw",
    ),
    _run(
        "off the road until no reset is left",
        "baja-highway",
        "wanderer",
        seconds=6,
        off_track_penalty_ms=200,
        max_resets=3,
    ),
    _run("commands that nobody trained", "kuei-super-raceway", "drifter", seconds=5, off_track_penalty_ms=500),
    _run("a car of the old console", "baja-turnpike", CONSOLE, seconds=4),
)

# What a worker drives at its start: continuous actions and a table, a lidar and boxes, bots; camera and network in all
# of them. Each comes to something else on a host whose libraries choose their code by processor.
PROOF = ("bots met with a lidar of sectors", "a duel", "camera and lidar among boxes")


def runs_of(names: Collection[str] = (), paths: Mapping[str, str] | None = None) -> list[GoldenRun]:
    """The runs of these names (default: all), without runs whose cars are missing. ``paths``: where the console's car
    is. Raises KeyError for an unknown name."""
    paths = paths or {}
    if unknown := set(names) - {run.name for run in RUNS}:
        raise KeyError(*unknown)
    chosen = [run for run in RUNS if not names or run.name in names]
    return [run.with_cars(paths) for run in chosen if CONSOLE not in run.cars or CONSOLE in paths]
