"""Gymnasium environments on the very stage that races are judged on. Importing this module registers them."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from tracks.geometry import TrackGeometry

from .action import DISCRETE, Action, ActionSpace
from .camera.theme import OFFICIAL, Theme
from .clock import STEP_MS
from .contestant import Contestant
from .physics import PADDOCK_CAR, CarPhysics
from .race import lap_results
from .referee import LAPS_DONE
from .rewards import RewardFunction, follow_centre_line, reward_params
from .rules import RaceRules
from .sensors import sensor_spec
from .stage import Ground, Stage
from .trace import TIME_UP

# Five angles at two speeds: what the console offered by default, at speeds that finish a lap in reasonable time.
DEFAULT_METADATA: Mapping[str, Any] = {
    "action_space_type": "discrete",
    "action_space": [
        {"steering_angle": angle, "speed": speed} for angle in (-30, -15, 0, 15, 30) for speed in (1.0, 1.5)
    ],
    "sensor": ["FRONT_FACING_CAMERA"],
}


class TimeTrialEnv(gymnasium.Env[dict[str, np.ndarray], Any]):
    """``Paddock/TimeTrial-v1``: drive laps alone on a track.

    Observation: a dict with one entry for each sensor of the metadata (a camera: uint8 (120, 160, 1)). Action: an
    index into the discrete action list, or two values in [-1, 1] for steering and speed. Reward: ``reward_function``
    of the documented params. An episode terminates when the laps are done or no reset is left for a fault, and is
    truncated when the simulated time is up. After a fault with resets left, the penalty passes within one step.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1000.0 / STEP_MS)}

    def __init__(
        self,
        track: TrackGeometry | str | os.PathLike[str] = "oval",
        direction: str = "ccw",
        metadata: Mapping[str, Any] = DEFAULT_METADATA,
        laps: int = 1,
        max_resets: int = 0,
        max_simulated_ms: int = 60_000,
        off_track_penalty_ms: int = 2000,
        start: str = "fixed",
        reward_function: RewardFunction = follow_centre_line,
        theme: Theme = OFFICIAL,
        physics: CarPhysics = PADDOCK_CAR,
        render_mode: str | None = None,
    ) -> None:
        """``track``: a geometry, a slug of the catalogue or the path of a .npy file. ``direction``: "ccw" or "cw".
        ``start``: "fixed" on the finish line or "random", anywhere on the centre line.

        Raises ValueError for a wrong argument or a sensor that is not here, UserFault for a track file that is refused.
        """
        if start not in ("fixed", "random"):
            raise ValueError(f"start must be 'fixed' or 'random', not {start!r}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.render_mode = render_mode
        self.rules = RaceRules(
            laps=laps,
            max_resets=max_resets,
            max_simulated_ms=max_simulated_ms,
            off_track_penalty_ms=off_track_penalty_ms,
            direction=direction,
        )
        self.actions = ActionSpace.from_metadata(metadata)
        self.sensors = tuple(metadata.get("sensor") or ("observation",))
        self._ground = Ground(load_track(track), direction, theme)
        self._physics = physics
        self._random_start = start == "random"
        self._reward_function = reward_function
        self._waypoints = [(float(x), float(y)) for x, y in self._ground.track.centre]
        self._stage: Stage | None = None
        self._car: Contestant | None = None
        self._readings: dict[str, np.ndarray] = {}
        self.observation_space = spaces.Dict(
            {
                spec.name: spaces.Box(0, 255, spec.shape, np.dtype(spec.dtype).type)
                for spec in map(sensor_spec, sorted(self.sensors))
            }
        )
        self.action_space = (
            spaces.Discrete(self.actions.size)
            if self.actions.kind == DISCRETE
            else spaces.Box(-1.0, 1.0, (self.actions.size,), np.float32)
        )

    @property
    def track(self) -> TrackGeometry:
        """The track in the driven direction."""
        return self._ground.track

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Start an episode. ``options={"start_m": metres}`` sets the start on the centre line."""
        super().reset(seed=seed)
        start_m = float((options or {}).get("start_m", 0.0))
        if self._random_start and "start_m" not in (options or {}):
            start_m = float(self.np_random.uniform(0.0, self.track.length))
        if self._stage is None:
            self._stage = Stage(self._ground, self.rules, self._physics)
        self._stage.clear()
        self._car = self._stage.add(self.sensors, start_m)
        self._readings = self._car.observe()
        return dict(self._readings), self._info()

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """One control step, and after a fault with resets left the penalty's steps too. Raises ValueError for a reward
        that is not finite."""
        if self._stage is None or self._car is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        car, stage = self._car, self._stage
        stage.step((self._decode(action),))
        reward = self._reward()
        car.reward = reward
        info = self._info()
        while car.pausing and not car.done:
            stage.step((None,))
            car.reward = 0.0
        self._readings = car.observe()
        ended = car.referee.end_reason
        if ended is not None:
            info["laps"] = [lap.to_dict() for lap in lap_results(car)]
            info["end_reason"] = ended
        return dict(self._readings), reward, ended is not None and ended != TIME_UP, ended == TIME_UP, info

    def render(self) -> np.ndarray | None:
        """The camera's last frame as RGB, uint8 (120, 160, 3), in render mode ``rgb_array``."""
        if self.render_mode is None or not self._readings:
            return None
        return np.repeat(next(iter(self._readings.values())), 3, axis=2)

    def close(self) -> None:
        """Free the world; the environment may be reset again."""
        if self._stage is not None:
            self._stage.close()
        self._stage = self._car = None

    def _decode(self, action: Any) -> Action:
        if self.actions.kind == DISCRETE:
            index = int(action)
            return Action(*self.actions.actions[index], index)
        return self.actions.decode(np.asarray(action, np.float32), self._car.referee.step + 1 if self._car else 0)

    def _reward(self) -> float:
        params = reward_params(self._car, self._waypoints, self.track.direction == "cw")
        reward = float(self._reward_function(params))
        if not math.isfinite(reward):
            raise ValueError(f"the reward function returned {reward}; it must return a finite number")
        return reward

    def _info(self) -> dict[str, Any]:
        referee = self._car.referee
        return {
            "status": self._car.status,
            "progress": referee.percent,
            "lap": referee.lap.number,
            "resets": referee.resets,
            "time_ms": referee.time_ms,
            "is_success": referee.end_reason == LAPS_DONE,
        }


def load_track(track: TrackGeometry | str | os.PathLike[str]) -> TrackGeometry:
    """A geometry as it is, one of the catalogue by its slug, or one from a .npy file. Raises ValueError for a slug that
    is not in the catalogue and is no file either, UserFault for a file that is refused."""
    if isinstance(track, TrackGeometry):
        return track
    if isinstance(track, str) and not track.endswith(".npy"):
        from tracks.catalogue import CATALOGUE

        for entry in CATALOGUE:
            if entry.slug == track:
                return entry.geometry()
        raise ValueError(f"no track {track!r}; the catalogue has {', '.join(entry.slug for entry in CATALOGUE)}")
    from tracks.npy import read_npy

    path = Path(track)
    return read_npy(path.read_bytes(), path.stem)


gymnasium.register(id="Paddock/TimeTrial-v1", entry_point=f"{__name__}:TimeTrialEnv")
