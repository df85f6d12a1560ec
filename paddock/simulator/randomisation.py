"""Domain randomisation: what an episode changes about the world, so that a policy does not hang on one picture of it.

deepracer-simapp (ENABLE_DOMAIN_RANDOMIZATION) draws the light and the colours of boxes and bots for each episode. Here
each of five things has a strength of its own, and every draw comes from the generator of the episode. Races have none
of it; a car's report drives under some of it (:mod:`.variations`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from .action import Action
from .camera.theme import Theme
from .car import Pose
from .lidar import LEAST_M, RAW_LIMIT_M

# What a strength of 1 comes to.
LIGHT_LEAST, LIGHT_MOST = 0.35, 1.5  # the light is between so much and so many times the usual
COLOUR_GREYS = 45.0  # each surface's grey moves by so much at most
START_OFFSET, START_TURN_DEG = 0.25, 20.0  # so much of the road's width to either side, and so many degrees
CAMERA_GREYS, LIDAR_SHARE = 12.0, 0.05  # standard deviation of a pixel, and of a distance as a share of it
LATENCY_STEPS = 3  # an action is carried out so many control steps later at most

_PICTURES = 4  # of noise that an episode draws and takes by turns: as good as new ones, and a tenth of the time
_STOPPED = Action(0.0, 0.0, None)


@dataclass(frozen=True)
class Randomisation:
    """How much of each an episode changes: 0 nothing, 1 as much as is sensible.

    ``light``: brightness of the camera's picture. ``colours``: the grey of road, lines, field, walls, boxes and cars,
    each by itself. ``start``: to the side of the centre line and turned. ``sensors``: noise on camera and lidar.
    ``latency``: control steps from an action to what the car does. Raises ValueError for what is no strength.
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
        """The strengths by their names; None is nothing. Raises ValueError that says which names there are."""
        if isinstance(strengths, Randomisation):
            return strengths
        known = [one.name for one in dataclasses.fields(cls)]
        given = dict(strengths or {})
        if unknown := given.keys() - set(known):
            raise ValueError(f"nothing randomises {', '.join(sorted(unknown))}; there are {', '.join(known)}")
        return cls(**given)

    def draw(self, rng: np.random.Generator, theme: Theme) -> Disturbance:
        """What one episode is like."""
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
        """The grey that each grey of the usual picture becomes, uint8 (256,); None for the same."""
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
    """What is other than usual in one episode. See :class:`Randomisation` for what is drawn.

    ``greys``: the table of greys; ``aside``: a share of the road's width to the left; ``turn``: radians to the left;
    ``noise``: int16 (pictures, rows, columns); ``latency``: control steps.
    """

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
        """Whether a car starts elsewhere than usual."""
        return bool(self.aside or self.turn)

    def place(self, pose: Pose, width: float) -> Pose:
        """Where a car starts that would at ``pose``, on a road of so many metres."""
        left = self.aside * width
        return Pose(
            pose.x - left * math.sin(pose.yaw),
            pose.y + left * math.cos(pose.yaw),
            math.remainder(pose.yaw + self.turn, 2.0 * math.pi),
        )

    def act(self, action: Action) -> Action:
        """What the car does now that it is told ``action``."""
        if not self.latency:
            return action
        self._waiting.append(action)
        return self._waiting.pop(0) if len(self._waiting) > self.latency else _STOPPED

    def observe(self, readings: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What the sensors say in place of ``readings``."""
        if self.greys is None and self.noise is None:
            return readings
        return {name: self._sensed(name, reading) for name, reading in readings.items()}

    def _sensed(self, name: str, reading: np.ndarray) -> np.ndarray:
        if reading.ndim == 3:
            return self._seen(reading)
        return self._felt(reading) if name == "LIDAR" and self.rng is not None else reading

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

    def _felt(self, metres: np.ndarray) -> np.ndarray:
        """The raw lidar; those in sectors say only whether something is near."""
        assert self.rng is not None, "only sensors with noise are asked"
        noise = self.rng.standard_normal(metres.shape, np.float32) * np.float32(self.lidar_noise)
        return np.clip(metres * (np.float32(1.0) + noise), np.float32(LEAST_M), np.float32(RAW_LIMIT_M))


NOTHING, USUAL = Randomisation(), Disturbance()


def _surfaces(theme: Theme) -> set[float]:
    """The greys of all that a camera sees."""
    flat: Sequence[int] = (theme.road, theme.line, theme.dash, theme.field, theme.wall, theme.sky)
    return {float(grey) for grey in (*flat, *theme.box, *theme.car, theme.car_window, theme.car_wheel)}
