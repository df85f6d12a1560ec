"""Domain randomisation of episodes, and the variations of a lap that a car's report drives."""

# After deepracer-simapp (ENABLE_DOMAIN_RANDOMIZATION), which draws the light and the colours of boxes and bots for each
# episode. Every draw comes from the generator of the episode. Races do not use it, a car's report does
# (:class:`Variation`).

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.random import default_rng  # imported before the sandbox's lock

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.report import ALL, COLOURS, LIGHT, SENSORS, START, VARIATIONS, kind_of, percent_of

from .action import Action
from .camera.theme import Theme
from .car import Pose
from .lidar import LEAST_M, RAW_LIMIT_M
from .physics import PADDOCK_CAR, CarPhysics

# The effect of a strength of 1.
LIGHT_LEAST, LIGHT_MOST = 0.35, 1.5  # factors of the brightness
COLOUR_GREYS = 45.0  # the greatest change of a surface's grey
START_OFFSET, START_TURN_DEG = 0.25, 20.0  # share of the road's width to either side; degrees
CAMERA_GREYS, LIDAR_SHARE = 12.0, 0.05  # standard deviation of a pixel, and of a distance as a share of it
LATENCY_STEPS = 3  # the longest delay of an action, in control steps

_PICTURES = 4  # pictures of noise that an episode uses by turns
_STOPPED = Action(0.0, 0.0, None)


@dataclass(frozen=True)
class Randomisation:
    """The strength of each change, 0 to 1.

    ``light``: brightness of the camera's picture. ``colours``: the grey of each surface. ``start``: offset from the
    centre line and heading. ``sensors``: noise on camera and lidar. ``latency``: delay of actions. Raises ValueError.
    """

    light: float = 0.0
    colours: float = 0.0
    start: float = 0.0
    sensors: float = 0.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        for name, value in dataclasses.asdict(self).items():
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0.0 <= value <= 1.0:  # not for NaN either
                raise ValueError(f"the strength of {name} must be a number from 0 to 1, not {value!r}")

    def __bool__(self) -> bool:
        return any(dataclasses.astuple(self))

    @classmethod
    def of(cls, strengths: Randomisation | Mapping[str, float] | None) -> Randomisation:
        """The strengths by their names. Raises ValueError with the known names."""
        if isinstance(strengths, Randomisation):
            return strengths
        known = [one.name for one in dataclasses.fields(cls)]
        given = dict(strengths or {})
        if unknown := given.keys() - set(known):
            raise ValueError(f"nothing randomises {', '.join(sorted(unknown))}; there are {', '.join(known)}")
        return cls(**given)

    def draw(self, rng: np.random.Generator, theme: Theme) -> Disturbance:
        """The changes of one episode."""
        return Disturbance(
            greys=self._greys(rng, theme),
            aside=rng.uniform(-1.0, 1.0) * START_OFFSET * self.start if self.start else 0.0,
            turn=math.radians(rng.uniform(-1.0, 1.0) * START_TURN_DEG * self.start) if self.start else 0.0,
            noise=self._noise(rng),
            lidar_noise=LIDAR_SHARE * self.sensors,
            latency=int(rng.integers(0, round(LATENCY_STEPS * self.latency), endpoint=True)) if self.latency else 0,
            rng=rng if self.sensors else None,
        )

    def _greys(self, rng: np.random.Generator, theme: Theme) -> np.ndarray | None:
        """The new grey of each usual grey, uint8 (256,); None for no change."""
        if not (self.light or self.colours):
            return None
        greys = np.arange(256.0)
        if self.colours:
            usual = np.array(sorted(_surfaces(theme)))
            moved = np.clip(usual + rng.uniform(-1.0, 1.0, len(usual)) * COLOUR_GREYS * self.colours, 0.0, 255.0)
            greys = np.interp(greys, usual, moved)
        if self.light:
            dark, bright = (1.0 + self.light * (end - 1.0) for end in (LIGHT_LEAST, LIGHT_MOST))
            greys *= rng.uniform(dark, bright)
        return np.rint(np.clip(greys, 0.0, 255.0)).astype(np.uint8)

    def _noise(self, rng: np.random.Generator) -> np.ndarray | None:
        if not self.sensors:
            return None
        drawn = rng.standard_normal((_PICTURES, 120, 160), np.float32) * np.float32(CAMERA_GREYS * self.sensors)
        return np.rint(drawn).astype(np.int16)


@dataclass
class Disturbance:
    """The changes of one episode. ``greys``: a table of greys; ``aside``: a share of the road's width to the left;
    ``turn``: radians to the left; ``noise``: int16 (pictures, rows, columns); ``latency``: control steps."""

    greys: np.ndarray | None = None
    aside: float = 0.0
    turn: float = 0.0
    noise: np.ndarray | None = None
    lidar_noise: float = 0.0
    latency: int = 0
    rng: np.random.Generator | None = None
    _waiting: list[Action] = field(default_factory=list)
    _shown: int = 0

    @property
    def moves_the_start(self) -> bool:
        """Whether the car starts off the centre line or turned."""
        return bool(self.aside or self.turn)

    def place(self, pose: Pose, width: float) -> Pose:
        """The start of a car that would start at ``pose``, on a road of ``width`` metres."""
        left = self.aside * width
        return Pose(
            pose.x - left * math.sin(pose.yaw),
            pose.y + left * math.cos(pose.yaw),
            math.remainder(pose.yaw + self.turn, 2.0 * math.pi),
        )

    def act(self, action: Action) -> Action:
        """The delayed action that the car executes now, when it receives ``action``."""
        if not self.latency:
            return action
        self._waiting.append(action)
        return self._waiting.pop(0) if len(self._waiting) > self.latency else _STOPPED

    def observe(self, readings: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The disturbed readings; of the lidars the raw one alone."""
        if self.greys is None and self.noise is None:
            return readings
        disturbed = {}
        for name, reading in readings.items():
            if reading.ndim == 3:
                reading = self._seen(reading)
            elif name == "LIDAR" and self.rng is not None:
                noise = self.rng.standard_normal(reading.shape, np.float32) * np.float32(self.lidar_noise)
                reading = np.clip(reading * (np.float32(1.0) + noise), np.float32(LEAST_M), np.float32(RAW_LIMIT_M))
            disturbed[name] = reading
        return disturbed

    def _seen(self, picture: np.ndarray) -> np.ndarray:
        if self.greys is not None:
            picture = cv2.LUT(picture, self.greys).reshape(picture.shape)
        if self.noise is None:
            return picture
        channels = []
        for channel in range(picture.shape[2]):
            noise = self.noise[self._shown % len(self.noise)]
            self._shown += 1
            plane = np.ascontiguousarray(picture[:, :, channel])
            channels.append(cv2.add(plane, noise, dtype=cv2.CV_8U))
        return np.stack(channels, axis=2)


NOTHING, USUAL = Randomisation(), Disturbance()


def _surfaces(theme: Theme) -> set[float]:
    """The greys of all that a camera sees."""
    flat: Sequence[int] = (theme.road, theme.line, theme.dash, theme.field, theme.wall, theme.sky)
    return {float(grey) for grey in (*flat, *theme.box, *theme.car, theme.car_window, theme.car_wheel)}


# The changes of each kind; START and ALL also begin anywhere on the lap.
_CHANGES: Mapping[str, tuple[str, ...]] = {
    **{kind: (kind,) for kind in (START, LIGHT, COLOURS, SENSORS)},
    ALL: (START, LIGHT, COLOURS, SENSORS),
}


@dataclass(frozen=True)
class Variation:
    """One variation. ``number``: from 0; ``percent``: its strength; ``start_m``: where the lap begins and ends, metres
    after the finish line."""

    number: int
    kind: str
    percent: int
    start_m: float
    seed: int

    def disturbance(self, theme: Theme) -> Disturbance:
        """The changes of one drive, to be drawn anew for each drive."""
        strength = self.percent / 100.0
        drawn = Randomisation(**dict.fromkeys(_CHANGES[self.kind], strength))
        return drawn.draw(default_rng((self.seed, self.number)), theme)


def variations(seed: int, length_m: float) -> list[Variation]:
    found = []
    for number in range(VARIATIONS):
        kind = kind_of(number)
        anywhere = float(default_rng((seed, number, 1)).uniform(0.0, length_m))
        start_m = round(anywhere, 3) % length_m if START in _CHANGES[kind] else 0.0
        found.append(Variation(number, kind, percent_of(number), start_m, seed))
    return found


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
