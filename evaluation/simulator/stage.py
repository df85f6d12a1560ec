"""A track with its world and the cars on it. A race and the Gymnasium environment drive on the same stage."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import TracebackType

from tracks.geometry import TrackGeometry

from .action import Action
from .camera.theme import OFFICIAL, Theme
from .camera.view import Scene
from .contestant import Contestant
from .physics import PADDOCK_CAR, CarPhysics
from .progress import Reach, clear_distance
from .referee import Referee
from .rules import RaceRules
from .sensors import make_sensors
from .world import World


class Ground:
    """What is prepared once for a track and shared by every run on it: the driven direction, its scene, its reach."""

    def __init__(self, track: TrackGeometry, direction: str = "ccw", theme: Theme = OFFICIAL) -> None:
        self.track = track.in_direction(direction)
        self.theme = theme

    @cached_property
    def scene(self) -> Scene:
        """Drawn when the first camera needs it."""
        return Scene.of(self.track, self.theme)

    @cached_property
    def reach(self) -> Reach:
        """See :class:`evaluation.simulator.progress.Reach`."""
        return Reach(self.track)

    @cached_property
    def clear_m(self) -> float:
        """See :func:`evaluation.simulator.progress.clear_distance`."""
        return clear_distance(self.track)


class Stage:
    """One run: a fresh world and its contestants. Use it as a context manager or call :meth:`close`."""

    def __init__(self, ground: Ground, rules: RaceRules, physics: CarPhysics = PADDOCK_CAR) -> None:
        self.ground = ground
        self.rules = rules
        self.world = World(physics)
        self.contestants: list[Contestant] = []

    def add(self, sensors: Sequence[str], start_m: float = 0.0) -> Contestant:
        """A car on the centre line, its base ``start_m`` metres after the finish (deepracer-simapp starts at 0)."""
        ground = self.ground
        referee = Referee(ground.track, self.rules, self.world.physics, ground.reach, start_m, ground.clear_m)
        contestant = Contestant(self.world.add_car(), referee, make_sensors(sensors, lambda: self.ground.scene))
        self.contestants.append(contestant)
        return contestant

    def clear(self) -> None:
        """Take all cars off the track for another run, which is then as one on a new stage."""
        self.contestants.clear()
        self.world.clear()

    def step(self, actions: Sequence[Action | None]) -> None:
        """One control step. ``actions``: one for each contestant, None for those that pause or are done."""
        driving = False
        for contestant, action in zip(self.contestants, actions, strict=True):
            if contestant.done:
                continue
            if contestant.pausing:
                contestant.stand()
            else:
                assert action is not None, "a driving car needs an action"
                contestant.command(action)
                driving = True
        if driving:  # while all stand still the world stands still with them
            self.world.step()
        for contestant in self.contestants:
            if not contestant.done:
                contestant.judge()

    def close(self) -> None:
        """Free the world."""
        self.world.close()

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
