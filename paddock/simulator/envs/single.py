"""The environments of one car."""

from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np

from paddock.exact import is_pinned
from paddock.geometry.track import TrackGeometry

from ..physics import STEP_MS
from .drive import Drive, NotCopied
from .setting import Readings, Setting, head_to_head, object_avoidance, time_trial

RENDER_MODES = ("rgb_array",)


class RacingEnv(NotCopied, gymnasium.Env[Any, Any]):
    """A car on a track. Its children are registered, one for each race type.

    Observation: a dict with one entry for each sensor of the metadata (a camera: uint8 (120, 160, 1), stereo cameras 2
    channels; a lidar: a row of float32), or with ``observation="box"`` the only sensor's reading. Action: an index into
    the action list, or two values in [-1, 1] for steering and speed. Reward: ``reward_function`` of the documented
    params. An episode terminates when the laps are done or no reset is left for a fault, and is truncated when the
    simulated time is up. After a fault with resets left, the penalty passes within one step.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": round(1000.0 / STEP_MS)}

    make_setting: ClassVar[Callable[..., Setting]]  # of a child: one of :mod:`.setting`

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        """``options``: see :func:`.configuration.default_config`. Raises ValueError for an unknown render mode."""
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.render_mode = render_mode
        self.setting = setting = self.make_setting(**options)
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
        """Whether results are the same to the bit on every x86-64 processor: the process was started by
        ``python -m paddock.exact``."""
        return is_pinned()

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Readings | np.ndarray, dict[str, object]]:
        """Start an episode. ``options={"start_m": metres}`` sets the start on the centre line. Raises ValueError."""
        super().reset(seed=seed)
        info = self._drive.begin(self.np_random, options)
        self._readings = self._drive.observe()
        return self.setting.present(dict(self._readings)), dict(info)

    def step(self, action: Any) -> tuple[Readings | np.ndarray, float, bool, bool, dict[str, object]]:
        """One control step, with the steps of a penalty. Raises ValueError for an invalid action and a reward that is
        not finite, ResetNeeded without a running episode."""
        if not self._drive.began:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if self._drive.car.done:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset() before step()")
        self._drive.command(action)
        self._drive.stage.world.step()
        reward, terminated, truncated, info = self._drive.judge()
        self._readings = self._drive.observe()
        return self.setting.present(dict(self._readings)), reward, terminated, truncated, dict(info)

    def render(self) -> np.ndarray | None:
        """The last frame of the (left) camera as RGB, uint8 (120, 160, 3), in render mode ``rgb_array``."""
        if self.render_mode is None or not self._readings:
            return None
        return picture(self._readings)

    def close(self) -> None:
        """Free the world; the environment may be reset again."""
        self._drive.close()


class TimeTrialEnv(RacingEnv):
    """``Paddock/TimeTrial-v1``: drive laps alone on a track."""

    make_setting = staticmethod(time_trial)


class ObjectAvoidanceEnv(RacingEnv):
    """``Paddock/ObjectAvoidance-v1``: drive laps past boxes."""

    make_setting = staticmethod(object_avoidance)


class HeadToHeadEnv(RacingEnv):
    """``Paddock/HeadToHead-v1``: drive laps among bot cars."""

    make_setting = staticmethod(head_to_head)


def picture(readings: Readings) -> np.ndarray:
    """The frame of the camera as RGB, uint8 (120, 160, 3)."""
    frame = next(reading for reading in readings.values() if reading.ndim == 3)
    return np.repeat(frame[:, :, :1], 3, axis=2)
