"""The environments of one car."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from paddock.exact import is_pinned
from paddock.geometry.track import TrackGeometry

from ..clock import STEP_MS
from .drive import Drive, NotCopied
from .setting import Readings, Setting, head_to_head, object_avoidance, time_trial

RENDER_MODES = ("rgb_array",)


class RacingEnv(NotCopied, gymnasium.Env[Any, Any]):
    """A car on a track. Not registered itself: its children are, one for each race type.

    Observation: a dict with one entry for each sensor of the metadata (a camera: uint8 (120, 160, 1), stereo cameras 2
    channels; a lidar: a row of float32), or with ``observation="box"`` the only sensor's reading itself. Action: an
    index into the discrete action list, or two values in [-1, 1] for steering and speed. Reward: ``reward_function`` of
    the documented params. An episode terminates when the laps are done or no reset is left for a fault, and is
    truncated when the simulated time is up. After a fault with resets left, the penalty passes within one step.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": round(1000.0 / STEP_MS)}

    def __init__(self, setting: Setting, render_mode: str | None = None) -> None:
        """Raises ValueError for an unknown render mode."""
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.render_mode = render_mode
        self.setting = setting
        self.observation_space = setting.observation_space
        self.action_space = setting.action_space
        self._drive = Drive(setting)
        self._readings: Readings = {}

    @property
    def track(self) -> TrackGeometry:
        """The track in the driven direction."""
        return self.setting.ground.track

    @property
    def exact(self) -> bool:
        """Whether this process was started so that what it drives is the same to the bit on every x86-64 processor, as
        the site's processes are: by ``python -m paddock.exact``."""
        return is_pinned()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Readings | np.ndarray, dict[str, Any]]:
        """Start an episode. ``options={"start_m": metres}`` sets the start on the centre line.

        Raises ValueError for an unknown option and for a start that is not on the lap.
        """
        super().reset(seed=seed)
        info = self._drive.begin(self.np_random, options)
        self._readings = self._drive.observe()
        return self.setting.present(dict(self._readings)), info

    def step(self, action: Any) -> tuple[Readings | np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step, and after a fault with resets left the penalty's steps too.

        Raises ValueError for an action that is not in the action space and for a reward that is not finite, ResetNeeded
        where no episode is under way.
        """
        if not self._drive.began:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if self._drive.car.done:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset() before step()")
        self._drive.command(action)
        self._drive.world.step()
        outcome = self._drive.judge()
        self._readings = self._drive.observe()
        return self.setting.present(dict(self._readings)), *outcome

    def render(self) -> np.ndarray | None:
        """The camera's last frame as RGB, uint8 (120, 160, 3), in render mode ``rgb_array``; of a stereo pair the left
        one."""
        if self.render_mode is None or not self._readings:
            return None
        return picture(self._readings)

    def close(self) -> None:
        """Free the world; the environment may be reset again."""
        self._drive.close()


class TimeTrialEnv(RacingEnv):
    """``Paddock/TimeTrial-v1``: drive laps alone on a track. Arguments: :func:`.setting.time_trial`."""

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        super().__init__(time_trial(**options), render_mode)


class ObjectAvoidanceEnv(RacingEnv):
    """``Paddock/ObjectAvoidance-v1``: drive laps past boxes. Arguments: :func:`.setting.object_avoidance`."""

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        super().__init__(object_avoidance(**options), render_mode)


class HeadToHeadEnv(RacingEnv):
    """``Paddock/HeadToHead-v1``: drive laps among bot cars. Arguments: :func:`.setting.head_to_head`."""

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        super().__init__(head_to_head(**options), render_mode)


def picture(readings: Readings) -> np.ndarray:
    """The camera's frame as RGB, uint8 (120, 160, 3)."""
    frame = next(reading for reading in readings.values() if reading.ndim == 3)
    return np.repeat(frame[:, :, :1], 3, axis=2)
