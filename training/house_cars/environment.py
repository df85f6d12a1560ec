"""The training environment of house cars (several tracks, both directions, frames with varied light), and scores."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
import onnxruntime
from gymnasium import spaces

import paddock.simulator.envs  # noqa: F401  registers the environments
from paddock.geometry.catalogue import by_slug
from paddock.packages.metadata import MetadataDocument
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.physics import STEP_MS
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.rewards import Params

from .recipes import TRACKS, Recipe

SENSOR = "FRONT_FACING_CAMERA"
POOL = 4  # the network sees the mean of 4 x 4 pixels; pooled here, learning stores a sixteenth
EPISODE_MS = 20_000
ROUTES: tuple[tuple[str, str], ...] = tuple((slug, way) for slug in TRACKS for way in ("ccw", "cw"))


def pool(frame: np.ndarray) -> np.ndarray:
    """uint8 (120, 160, 1) to float32 (1, 30, 40) in [0, 1]: the mean of each block of 4 x 4 pixels."""
    rows, columns = frame.shape[0] // POOL, frame.shape[1] // POOL
    blocks = frame.reshape(rows, POOL, columns, POOL).sum(axis=(1, 3), dtype=np.int32)
    return (blocks.astype(np.float32) / np.float32(255 * POOL * POOL))[None]


class Forward:
    """Reward: metres gained along the track in a step, as a share of full speed, less towards the edge of the road."""

    def __init__(self, recipe: Recipe, top_speed: float) -> None:
        self._focus = recipe.focus
        self._full_step = top_speed * STEP_MS / 1000.0
        self._before: float | None = None

    def __call__(self, params: Params) -> float:
        length = params["track_length"]
        gained = math.remainder(params["projection_distance"] - (self._before or 0.0), length)
        self._before = params["projection_distance"]
        if params["is_offtrack"] or abs(gained) > 1.0:
            return 0.0
        aside = min(2.0 * params["distance_from_center"] / params["track_width"], 1.0)
        return gained / self._full_step * (1.0 - self._focus * aside)


class Daylight(gymnasium.Wrapper):
    """Pooled frames in another light each episode, with a little noise: what is learned must not hang on exact greys.

    Observation: float32 (1, 30, 40). Brightness moves by up to 0.12 (of 1), contrast by up to 20 %, noise is 0.01.
    """

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        space = env.observation_space
        assert isinstance(space, spaces.Dict), "a picture for each sensor"
        rows, columns, _ = space[SENSOR].shape or ()
        self.observation_space = spaces.Box(-1.0, 2.0, (1, rows // POOL, columns // POOL), np.float32)
        self._rng = np.random.default_rng()
        self._contrast, self._brightness = 1.0, 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, object] | None = None) -> tuple[np.ndarray, dict]:
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self._contrast = self._rng.uniform(0.8, 1.2)
        self._brightness = self._rng.uniform(-0.12, 0.12)
        readings, info = self.env.reset(seed=seed, options=options)
        return self._see(readings), info

    def step(self, action: Any) -> tuple[np.ndarray, SupportsFloat, bool, bool, dict]:
        readings, reward, terminated, truncated, info = self.env.step(action)
        return self._see(readings), reward, terminated, truncated, info

    def _see(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        small = pool(readings[SENSOR])
        noise = self._rng.normal(0.0, 0.01, small.shape)
        return ((small - 0.5) * self._contrast + 0.5 + self._brightness + noise).astype(np.float32)


def make_env(recipe: Recipe, slug: str, direction: str) -> Callable[[], gymnasium.Env]:
    """A maker of one environment: random starts, an episode ends off the track or after 20 simulated seconds."""

    def make() -> gymnasium.Env:
        return Daylight(
            gymnasium.make(
                "Paddock/TimeTrial-v1",
                track=slug,
                direction=direction,
                metadata=recipe.metadata,
                laps=1000,
                max_simulated_ms=EPISODE_MS,
                start="random",
                reward_function=Forward(recipe, top_speed(recipe)),
            )
        )

    return make


def top_speed(recipe: Recipe) -> float:
    if recipe.action_space_type == "continuous":
        return float(recipe.action_space["speed"]["high"])
    return max(float(action["speed"]) for action in recipe.action_space)


class OnnxDriver:
    """A network as a policy for :func:`paddock.simulator.race.run_race`: one thread, float32, no sandbox."""

    def __init__(self, onnx: bytes) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(onnx, options, providers=["CPUExecutionProvider"])

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        frame = readings[SENSOR].astype(np.float32).reshape(1, 1, 120, 160)
        return self._session.run(None, {SENSOR: frame})[0]


@dataclass(frozen=True)
class Score:
    """How a network drove one lap of each route, stopped at its first fault. Greater is better."""

    clean: int  # routes finished without a fault
    speed: float  # mean over all routes, m/s; a route not finished counts nothing
    distance: float  # mean share of the lap that was driven

    @property
    def key(self) -> tuple[float, float]:
        """Clean routes first; then speed where they are equal, and distance before any is clean."""
        return (self.clean + self.distance / 100.0 if not self.clean else float(self.clean), self.speed)


def score(onnx: bytes, metadata: MetadataDocument, routes: Sequence[tuple[str, str]]) -> Score:
    """Drive one lap from a standing start on each (slug, direction)."""
    space = ActionSpace.from_metadata(metadata)
    driver = OnnxDriver(onnx)
    clean, speed, distance = 0, 0.0, 0.0
    for slug, direction in routes:
        track = by_slug(slug).geometry()
        rules = RaceRules.of_an_episode(max_simulated_ms=120_000, direction=direction)
        lap = run_race(RaceSettings(track, rules, [Entrant(space, [SENSOR], driver)])).laps[0]
        distance += lap.completion_percentage / 100.0
        if lap.complete:
            clean += 1
            speed += track.length / (lap.time_ms / 1000.0)
    return Score(clean, speed / len(routes), distance / len(routes))
