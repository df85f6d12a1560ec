"""The environment ``deepracer-v0``, on the stage of the races."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, cast
from weakref import WeakSet

import cv2
import gymnasium
import numpy as np
from gymnasium import spaces

from paddock.geometry.track import TrackGeometry
from paddock.simulator.action import DISCRETE
from paddock.simulator.camera.colours import colours
from paddock.simulator.envs.drive import Drive, NotCopied, StepOutcome
from paddock.simulator.envs.setting import Readings, Setting
from paddock.simulator.physics import STEP_MS
from paddock.simulator.rewards import Params, follow_centre_line
from paddock.simulator.trace import CRASHED, IMMOBILIZED, LAP_COMPLETE, OFF_TRACK, REVERSED, TIME_UP

from .agent_config import FRONT, STEREO, AgentConfig, observation_space, read_agent_config
from .track_config import WORLD, make_setting, read_track_config

TERMINATED = (LAP_COMPLETE, CRASHED, OFF_TRACK, REVERSED)
TRUNCATED = (IMMOBILIZED, TIME_UP)

OPEN: WeakSet[DeepRacerEnv] = WeakSet()  # the environments of this process that are not closed

_log = logging.getLogger("paddock.deepracer")
_numbers = itertools.count(1)
_Step = tuple[Readings, float, bool, bool, dict[str, object]]


class DeepRacerEnv(NotCopied, gymnasium.Env[Readings, Any]):
    """One car on a track, as courses know it.

    Observation: ``STEREO_CAMERAS`` uint8 (2, 120, 160), ``FRONT_FACING_CAMERA`` uint8 (3, 120, 160) in colour,
    ``LIDAR`` float32 (64,). Action: an index into the list, or steering and speed in [-1, 1]. Info: ``reward_params``,
    of which the reward is made, and ``episode_status``, whose one true entry is the end of the episode.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1000.0 / STEP_MS)}

    def __init__(
        self,
        agent_config: AgentConfig | None = None,
        track_config: Mapping[str, Any] | None = None,
        reward_function: Callable[[Params], Any] | None = None,
        world_name: str | None = None,
        evaluation: bool = False,
        render_mode: str | None = "rgb_array",
        image: str | None = None,
        cpus: float = 3.0,
        memory: str = "6g",
        cache: bool = False,
        manage_container: bool = True,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        """Raises TypeError and ValueError with the name of the argument or key."""
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        _log.debug(
            "there is no container here: ignored are image=%r, cpus=%r, memory=%r, cache=%r, manage_container=%r, "
            "host=%r, port=%r",
            *(image, cpus, memory, cache, manage_container, host, port),
        )
        self.render_mode = render_mode
        self.agent_config = read_agent_config(agent_config)
        self.track_config = read_track_config(track_config, world_name, evaluation)
        self.reward_function: Callable[[Params], Any] = reward_function or follow_centre_line
        self.setting: Setting = make_setting(
            self.track_config, metadata=self.agent_config, reward_function=self._reward_of_step
        )
        self._sensors: tuple[str, ...] = tuple(self.agent_config["sensor"])
        self.observation_space = cast("spaces.Space[Readings]", observation_space(self._sensors))
        actions = self.setting.actions
        self.action_space: spaces.Discrete | spaces.Box = (
            spaces.Discrete(actions.size) if actions.kind == DISCRETE else spaces.Box(-1.0, 1.0, (2,), np.float64)
        )
        self.name = f"deepracer-{next(_numbers)} {self.track_config[WORLD]}"
        self._drive = Drive(self.setting)
        self._params: Params = {}
        self._seen: Readings = {}
        self._last: _Step | None = None
        OPEN.add(self)

    @property
    def track(self) -> TrackGeometry:
        """The track in the direction of the first episode."""
        return self.setting.ground.track

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Readings, dict[str, object]]:
        """Start an episode. The same ``seed`` gives the same one, with its direction. ``options={"start_m": metres}``
        sets the start. Raises ValueError."""
        super().reset(seed=seed)
        if seed is not None:
            self._drive.from_the_first()
        OPEN.add(self)
        self._drive.begin(self.np_random, options)
        self._last, self._params = None, self._drive.params()
        return self._observe(), self._info("")

    def step(self, action: Any) -> _Step:
        """One control step, 1/15 s. After the end of an episode its last step is returned again. Raises ValueError for
        an invalid action and a reward that is not finite, ResetNeeded before the first episode."""
        if not self._drive.began:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if self._last is not None:
            return self._last
        self._drive.command(action)
        self._drive.stage.world.step()
        outcome = self._drive.judge()
        status = _end_of(outcome)
        step = (self._observe(), outcome.reward, status in TERMINATED, status in TRUNCATED, self._info(status))
        if status:
            self._last = step
        return step

    def render(self, mode: str = "rgb_array") -> np.ndarray | None:
        """The last picture as RGB, uint8: of the front camera (120, 160, 3), of the pair side by side (120, 320, 3);
        None before the first episode."""
        if mode != "rgb_array":
            raise ValueError(f"mode must be 'rgb_array', not {mode!r}: show the array with the program of your choice")
        if not self._seen:
            return None
        if FRONT in self._seen:
            return np.ascontiguousarray(self._seen[FRONT].transpose(1, 2, 0))
        return np.repeat(np.hstack(tuple(self._seen[STEREO]))[:, :, None], 3, axis=2)

    def close(self, cache: bool | None = None) -> None:
        """Free the world; the environment may be reset again. ``cache`` is ignored."""
        self._drive.close()
        self._last, self._seen = None, {}
        OPEN.discard(self)

    def _reward_of_step(self, params: Params) -> float:
        self._params = params
        return self.reward_function(params)

    def _observe(self) -> Readings:
        readings = self._drive.observe()
        self._seen = {name: _presented(name, readings[name]) for name in self._sensors}
        return dict(self._seen)

    def _info(self, status: str) -> dict[str, object]:
        return {
            "reward_params": self._params,
            "episode_status": {name: name == status for name in (*TERMINATED, *TRUNCATED)},
        }


def _end_of(outcome: StepOutcome) -> str:
    """How the episode ended with this step; empty where it goes on."""
    if not (outcome.terminated or outcome.truncated):
        return ""
    return outcome.info["status"]


def _presented(name: str, reading: np.ndarray) -> np.ndarray:
    """A reading in the form of the observation space: channels first, the front camera in colour."""
    if name == FRONT:
        picture = np.empty((3, *reading.shape[:2]), np.uint8)
        for channel, table in zip(picture, _tables(), strict=True):
            cv2.LUT(reading[:, :, 0], table, channel)
        return picture
    return np.ascontiguousarray(reading.transpose(2, 0, 1)) if name == STEREO else reading


@cache
def _tables() -> tuple[np.ndarray, ...]:
    """The table of each channel, as OpenCV takes it."""
    return tuple(np.ascontiguousarray(colours().T))
