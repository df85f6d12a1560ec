"""The vector environments as ``VecEnv`` of stable-baselines3."""

#     from paddock.simulator.envs.sb3 import make_sb3_env
#
#     cars = make_sb3_env("Paddock/TimeTrial-v1", num_envs=16, observation="box", track="oval", start="random")
#     PPO("CnnPolicy", cars, seed=1).learn(100_000)
#
# Only racers' programs and the trainer import this module, as it needs stable-baselines3.

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, cast

import gymnasium
import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from ..vector import RacingVectorEnv
from .setting import Readings

Seen = np.ndarray | Readings

_ONE_WORLD = "all cars share one environment: give its arguments to make_sb3_env"


def make_sb3_env(race: str, num_envs: int = 16, *, seed: int | None = None, **options: Any) -> SB3VecEnv:
    """``num_envs`` cars for a learner of stable-baselines3. ``race``: an id such as ``"Paddock/TimeTrial-v1"``;
    ``options``: the arguments of that environment. ``seed``: as the learner's ``seed`` sets it."""
    env = gymnasium.make_vec(race, num_envs=num_envs, autoreset_mode="Disabled", copy=False, **options)
    return SB3VecEnv(env, seed=seed)


class SB3VecEnv(VecEnv):
    """Cars of one vector environment, each episode followed by the next within the step, as in a ``VecEnv``.

    Observations are those of the environment (see :meth:`look`), rewards float32. The info of an episode's last step
    has ``terminal_observation``, ``TimeLimit.truncated`` and ``episode`` (reward ``r``, length ``l``, seconds ``t``, as
    of ``Monitor``). Laps done count as truncated too: the car could have driven on.
    """

    def __init__(
        self,
        env: gymnasium.vector.VectorEnv,
        *,
        seed: int | None = None,
        observation_space: gymnasium.Space | None = None,
    ) -> None:
        """``env``: with ``autoreset_mode="Disabled"``, else ValueError. ``observation_space``: one car's of
        :meth:`look`."""
        if env.metadata["autoreset_mode"] is not gymnasium.vector.AutoresetMode.DISABLED:
            raise ValueError('make the environment with autoreset_mode="Disabled": episodes are begun anew here')
        self.env = cast(RacingVectorEnv, env)
        super().__init__(env.num_envs, observation_space or env.single_observation_space, env.single_action_space)
        if seed is not None:
            self.seed(seed)
        self._began = time.monotonic()
        self._actions: np.ndarray | None = None
        self._earned = np.zeros(self.num_envs)
        self._steps = np.zeros(self.num_envs, np.int64)

    def look(self, readings: Any) -> Seen:
        """The learner's observations from those of the environment: new arrays in every call."""
        return _copied(readings)

    def cut(self) -> np.ndarray:
        """The cars (bools) whose episode a child truncates with this step."""
        return np.zeros(self.num_envs, np.bool_)

    def again(self, cars: np.ndarray) -> Any:
        """Start the next episode of ``cars`` (bools); the environment's observations of all."""
        readings, _ = self.env.reset(options={"reset_mask": cars})
        return readings

    def ended(self, number: int, info: dict[str, object]) -> None:
        """Called at the end of a car's episode, while ``self.env`` still has its state. ``info``: of its last step."""

    def reset(self) -> Seen:
        """Start an episode of every car, from the seeds of a preceding :meth:`seed`."""
        if any(options != self._options[0] for options in self._options):
            raise ValueError("options of reset are the same for all cars")
        readings, infos_by_key = self.env.reset(seed=list(self._seeds), options=dict(self._options[0]))
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = _each(infos_by_key, self.num_envs)
        self._earned[:] = 0.0
        self._steps[:] = 0
        return self.look(readings)

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Seen, np.ndarray, np.ndarray, list[dict[str, object]]]:
        """One control step of every car; an episode that ends is followed by the next at once."""
        assert self._actions is not None, "step_async() takes them first"
        readings, rewards, terminated, truncated, infos_by_key = self.env.step(self._actions)
        self._earned += rewards
        self._steps += 1
        truncated = truncated | (self.cut() & ~terminated)
        seen, done = self.look(readings), terminated | truncated
        infos = _each(infos_by_key, self.num_envs)
        if done.any():
            for number in np.flatnonzero(done).tolist():
                self._end(number, infos[number], seen, bool(truncated[number]))
            seen = self.look(self.again(done))
            self._earned[done] = 0.0
            self._steps[done] = 0
        return seen, rewards.astype(np.float32), done, infos

    def _end(self, number: int, info: dict[str, object], seen: Seen, truncated: bool) -> None:
        info["TimeLimit.truncated"] = truncated or info["is_success"]
        info["terminal_observation"] = _copied(seen, number)
        info["episode"] = {
            "r": round(float(self._earned[number]), 6),
            "l": int(self._steps[number]),
            "t": round(time.monotonic() - self._began, 6),
        }
        self.ended(number, info)

    def close(self) -> None:
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """The last frame of each car, in render mode ``rgb_array``."""
        return self.env.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the one environment, for each car."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raises NotImplementedError: all cars share one environment."""
        raise NotImplementedError(_ONE_WORLD)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Raises NotImplementedError: all cars share one environment."""
        raise NotImplementedError(_ONE_WORLD)

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: Any = None) -> list[bool]:
        """True for ``Monitor``, whose task this class does."""
        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]


def _copied(seen: Seen, at: Any = ...) -> Seen:
    """A copy of the observations, or of those of the car ``at``."""
    return {name: batch[at].copy() for name, batch in seen.items()} if isinstance(seen, dict) else seen[at].copy()


def _each(infos_by_key: Mapping[str, np.ndarray], count: int) -> list[dict[str, object]]:
    """Gymnasium's infos, an array and a mask for each key, as a dict for each car."""
    infos: list[dict[str, object]] = [{} for _ in range(count)]
    for key, values in infos_by_key.items():
        if f"_{key}" in infos_by_key:
            for info, value, given in zip(infos, values.tolist(), infos_by_key[f"_{key}"].tolist(), strict=True):
                if given:
                    info[key] = value
    return infos
