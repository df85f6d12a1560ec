"""The cars that gather experience: the vectorised environment in stable-baselines3's form."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from evaluation.simulator.action import CONTINUOUS, ActionSpace
from evaluation.simulator.camera.theme import THEMES
from evaluation.simulator.referee import LAPS_DONE
from evaluation.simulator.rewards import RewardFunction
from evaluation.simulator.rules import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL
from evaluation.simulator.trace import LABELS, TIME_UP, Row, Trace
from evaluation.simulator.vector import HeadToHeadVectorEnv, ObjectAvoidanceVectorEnv, TimeTrialVectorEnv
from tracks.geometry import TrackGeometry

from .senses import Sense, look
from .spec import TrainerSpec
from .warm import row_space

KINDS = {
    TIME_TRIAL: TimeTrialVectorEnv,
    OBJECT_AVOIDANCE: ObjectAvoidanceVectorEnv,
    HEAD_TO_HEAD: HeadToHeadVectorEnv,
}
TRACE_ROWS = 6_000  # of an iteration's sim-trace; the newest episodes that fit


def lap_limit_ms(track: TrackGeometry, space: ActionSpace) -> int:
    """Simulated time in which a car of this action space ought to lap the track: half as long again as at the mean of
    its speeds, and ten seconds; 20 s to 4 minutes."""
    if space.kind == CONTINUOUS:
        speed = sum(space.speed) / 2.0
    else:
        speed = sum(speed for _, speed in space.actions) / len(space.actions)
    return int(min(max(1500.0 * track.length / max(speed, 0.1) + 10_000.0, 20_000.0), 240_000.0))


class Cars(VecEnv):
    """Many cars in one world, each from a random place of the track, until it leaves it, has done a lap or is out of
    time. Observations: rows, see :mod:`.senses`.

    An episode that ends with a lap or out of time is "truncated": the car could have driven on, and what it would have
    earned counts.
    """

    def __init__(
        self,
        spec: TrainerSpec,
        track: TrackGeometry,
        rewards: Sequence[RewardFunction],
        senses: list[Sense],
        seed: int,
    ) -> None:
        space = ActionSpace.from_metadata(spec.metadata)
        self._env = KINDS[spec.race_type](
            len(rewards),
            autoreset_mode="Disabled",
            copy=False,
            track=track,
            direction=track.direction,
            metadata=spec.metadata,
            laps=1,
            max_resets=0,
            max_simulated_ms=lap_limit_ms(track, space),
            start="random",
            reward_function=list(rewards),
            theme=THEMES[spec.look],
            **spec.course,
        )
        self._senses, self._seed = senses, seed
        super().__init__(len(rewards), row_space(senses), self._env.single_action_space)
        self._actions: np.ndarray | None = None
        self._earned = np.zeros(len(rewards))
        self.episodes: list[dict[str, Any]] = []  # those that ended since the last :meth:`harvest`
        self._rows: list[list[Row]] = []
        self.episode = 0

    def reset(self) -> np.ndarray:
        """Start an episode of every car."""
        readings, _ = self._env.reset(seed=self._seed)
        self._earned[:] = 0.0
        return look(self._senses, readings)

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One control step; an episode that ends is followed by the next at once."""
        readings, rewards, terminated, truncated, _ = self._env.step(self._actions)
        self._earned += rewards
        rows = look(self._senses, readings)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done.any():
            for number in np.flatnonzero(done).tolist():
                could_go_on = self._note(number)
                infos[number] = {"terminal_observation": rows[number].copy(), "TimeLimit.truncated": could_go_on}
            readings, _ = self._env.reset(options={"reset_mask": done})
            rows = look(self._senses, readings)
            self._earned[done] = 0.0
        return rows, rewards.astype(np.float32), done, infos

    def harvest(self) -> tuple[list[dict[str, Any]], bytes]:
        """The episodes since the last time, and the newest of their traces: a gzipped CSV, ``b""`` for none."""
        episodes, kept, count = self.episodes, [], 0
        for rows in reversed(self._rows):
            if count and count + len(rows) > TRACE_ROWS:
                break
            kept.append(rows)
            count += len(rows)
        self.episodes, self._rows = [], []
        if not count:
            return episodes, b""
        csv = Trace.of([row for rows in reversed(kept) for row in rows][-TRACE_ROWS:]).to_csv()
        return episodes, gzip.compress(csv, 1, mtime=0)

    def _note(self, number: int) -> bool:
        """Write down an episode that is over. Whether the car could have driven on."""
        car = self._env.car(number)
        referee = car.referee
        rows = [row._replace(episode=self.episode) for row in car.rows]
        self.episodes.append(
            {
                "episode": self.episode,
                "reward": round(float(self._earned[number]), 4),
                "progress": round(min(max(referee.percent, 0.0), 100.0), 2),
                "status": LABELS[car.status],
                "steps": len(rows),
                "time_ms": int(referee.time_ms),
            }
        )
        self._rows.append(rows)
        self.episode += 1
        return referee.end_reason in (LAPS_DONE, TIME_UP)

    def close(self) -> None:
        """Free the world."""
        self._env.close()

    # What else stable-baselines3's abstract class asks for. All cars live in one world, so there is no environment of
    # a car's own to reach into: whoever tries learns it at once.

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Callable, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs
