"""The old ``gym``, whose ``step`` returns four values, over Gymnasium.

import paddock.deepracer.old_gym as gym                     in place of ``import gym``
python -m paddock.deepracer.old_gym program.py ARGUMENTS    a program that is not changed at all
"""

from __future__ import annotations

import runpy
import sys
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces as spaces

__all__ = ["ActionWrapper", "Env", "ObservationWrapper", "RewardWrapper", "Wrapper", "install", "make", "spaces"]


class Env:
    """An environment of the old form: ``reset`` returns the observation alone, ``step`` four values."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def __getattr__(self, name: str) -> Any:
        if name == "env":  # before __init__, as in a copy
            raise AttributeError(name)
        return getattr(self.env, name)

    @property
    def unwrapped(self) -> Any:
        return self.env.unwrapped

    def seed(self, seed: int | None = None) -> list[int | None]:
        """The seed of the next :meth:`reset`."""
        self._seed = seed
        return [seed]

    def reset(self) -> Any:
        """Start an episode; its first observation."""
        seed, self._seed = self.__dict__.get("_seed"), None
        observation, _ = self.env.reset(seed=seed)
        return observation

    def step(self, action: Any) -> tuple[Any, float, bool, dict[str, object]]:
        """Observation, reward, whether the episode is over, info. ``TimeLimit.truncated`` in the info of the last step:
        whether it was cut short."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if terminated or truncated:
            info = {**info, "TimeLimit.truncated": bool(truncated and not terminated)}
        return observation, float(reward), bool(terminated or truncated), info

    def render(self, mode: str = "rgb_array") -> np.ndarray | None:
        """The last picture as RGB."""
        return self.env.unwrapped.render(mode)

    def close(self) -> None:
        self.env.close()


class Wrapper(Env):
    """The parent of a program's own wrappers of an :class:`Env`."""

    def seed(self, seed: int | None = None) -> Any:
        return self.env.seed(seed)

    def reset(self) -> Any:
        return self.env.reset()

    def step(self, action: Any) -> Any:
        return self.env.step(action)

    def render(self, mode: str = "rgb_array") -> Any:
        return self.env.render(mode)


class ObservationWrapper(Wrapper):
    """A child changes observations with ``observation(observation)``."""

    def observation(self, observation: Any) -> Any:
        raise NotImplementedError

    def reset(self) -> Any:
        return self.observation(self.env.reset())

    def step(self, action: Any) -> Any:
        observation, *rest = self.env.step(action)
        return (self.observation(observation), *rest)


class RewardWrapper(Wrapper):
    """A child changes rewards with ``reward(reward)``."""

    def reward(self, reward: float) -> float:
        raise NotImplementedError

    def step(self, action: Any) -> Any:
        observation, reward, done, info = self.env.step(action)
        return observation, self.reward(reward), done, info


class ActionWrapper(Wrapper):
    """A child changes actions with ``action(action)``."""

    def action(self, action: Any) -> Any:
        raise NotImplementedError

    def step(self, action: Any) -> Any:
        return self.env.step(self.action(action))


def make(name: str, **arguments: Any) -> Env:
    """As ``gym.make``."""
    return Env(gymnasium.make(name, **arguments))


def install() -> None:
    """Let ``import gym`` of this process give this module, unless a ``gym`` was imported before."""
    if "gym" not in sys.modules:
        gym = ModuleType("gym", __doc__)
        gym.__dict__.update({name: globals()[name] for name in __all__})
        sys.modules["gym"], sys.modules["gym.spaces"] = gym, spaces


def main() -> None:
    """Run a program in whose process ``import gym`` is this module."""
    if len(sys.argv) < 2:
        sys.exit("python -m paddock.deepracer.old_gym PROGRAM [ARGUMENTS]")
    install()
    del sys.argv[0]
    runpy.run_path(sys.argv[0], run_name="__main__")


if __name__ == "__main__":
    main()
