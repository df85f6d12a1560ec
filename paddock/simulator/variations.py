"""The variations of a lap that a car's report drives: each other than usual in one thing, or in all of them.

Five kinds, so many of each (:mod:`paddock.rules.report`), which grow from mild to as much as is sensible
(:mod:`.randomisation` says how much that is). Every draw comes from the report's seed and the variation's number alone:
they are the same in whatever order and by whichever worker they are driven. No Django.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy.random import default_rng  # now: a locked process reads no files any more

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.report import ALL, COLOURS, LIGHT, SENSORS, START, VARIATIONS, kind_of, percent_of

from .camera.theme import Theme
from .car import Pose
from .physics import PADDOCK_CAR, CarPhysics
from .randomisation import Disturbance, Randomisation

# What of the world a kind changes; START and ALL begin anywhere on the lap besides.
_CHANGES: Mapping[str, tuple[str, ...]] = {
    **{kind: (kind,) for kind in (START, LIGHT, COLOURS, SENSORS)},
    ALL: (START, LIGHT, COLOURS, SENSORS),
}


@dataclass(frozen=True)
class Variation:
    """One of them. ``number``: from 0; ``percent``: how strong, 100 being as much as is sensible; ``start_m``: where
    the lap begins and ends, metres after the finish line."""

    number: int
    kind: str
    percent: int
    start_m: float
    seed: int

    def disturbance(self, theme: Theme) -> Disturbance:
        """What is other than usual in one drive: draw it anew for each, as noise moves on while a car drives."""
        strength = self.percent / 100.0
        drawn = Randomisation(**dict.fromkeys(_CHANGES[self.kind], strength))
        return drawn.draw(default_rng((self.seed, self.number)), theme)


def variations(seed: int, length_m: float) -> list[Variation]:
    """All of them for a lap of so many metres."""
    return [_variation(number, seed, length_m) for number in range(VARIATIONS)]


def _variation(number: int, seed: int, length_m: float) -> Variation:
    kind = kind_of(number)
    anywhere = float(default_rng((seed, number, 1)).uniform(0.0, length_m))
    start_m = round(anywhere, 3) % length_m if START in _CHANGES[kind] else 0.0
    return Variation(number, kind, percent_of(number), start_m, seed)


def check_placed(track: TrackGeometry, variation: Variation, theme: Theme, physics: CarPhysics = PADDOCK_CAR) -> None:
    """Raises UserFault ``variation_not_placed`` where the car would not stand on the road with all its wheels."""
    if START not in _CHANGES[variation.kind]:
        return
    disturbance = variation.disturbance(theme)
    width = track.width_at(variation.start_m % track.length)
    pose = disturbance.place(Pose(*track.point_at(variation.start_m)), width)
    wheels = [
        pose.ahead(axle, side)
        for axle in (physics.front_axle_x, physics.rear_axle_x)
        for side in (physics.half_track, -physics.half_track)
    ]
    if not all(track.on_road(*wheel) for wheel in wheels):
        raise UserFault(
            "variation_not_placed",
            number=variation.number + 1,
            track=track.name,
            start_m=f"{variation.start_m:.2f}",
            width_m=f"{width:.2f}",
        )
