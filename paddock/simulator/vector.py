"""Vector environments: many cars in one Bullet world, which neither meet nor see each other."""

# Each car's observations, rewards and ends equal those of a single environment with the same seed and actions.
# ``gymnasium.make_vec("Paddock/TimeTrial-v1", num_envs=16, ...)`` creates one.

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import chain
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from paddock.exact import is_pinned

from .action import Action
from .competitor import Competitor
from .envs.drive import OPTIONS, Drive, EpisodeInfo, NotCopied, StepOutcome, check_options
from .envs.setting import Readings, Setting, head_to_head, object_avoidance, time_trial
from .envs.single import RENDER_MODES, RacingEnv, picture
from .stage import PreparedTrack
from .world import World, new_world

_Infos = dict[str, Any]


class RacingVectorEnv(NotCopied, VectorEnv[Readings | np.ndarray, np.ndarray, np.ndarray]):
    """Many cars on a track, one for each sub-environment. Its children are registered, one for each race type.

    ``autoreset_mode`` is Gymnasium's. NEXT_STEP (the default): the step after an episode's last one ignores the action,
    starts the next episode and returns its first observation, a reward of 0 and no end. SAME_STEP: the step that ends
    an episode already returns the next one's first observation, and the last one as ``final_obs`` and ``final_info``
    in the infos. DISABLED: the caller resets, all or by ``options={"reset_mask": ...}``.

    Seeds: ``reset(seed=7)`` seeds the cars with 7, 8, 9, ...; a list gives each its own. ``reward_function`` may be a
    list with one function for each car, for functions that keep a state.
    """

    make_setting: ClassVar[Callable[..., Setting]]  # of a child: one of :mod:`.envs.setting`

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        numbers_only: bool = False,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """``options``: those of a single environment. ``copy=False`` returns the same observation arrays from every
        call. ``numbers_only=True`` leaves ``status``, ``laps`` and ``end_reason`` out of the infos, as TorchRL's reader
        of SAME_STEP environments needs.

        Raises ValueError for fewer cars than one, an unknown autoreset mode or render mode, and a wrong number of
        reward functions.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs must be at least 1, not {num_envs}")
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        options = {**(options.pop("config", None) or {}), **options}
        rewards = options.get("reward_function")
        if isinstance(rewards, Sequence):
            if len(rewards) != num_envs:
                raise ValueError(f"{num_envs} cars need as many reward functions, not {len(rewards)}")
            setting = self.make_setting(**{**options, "reward_function": rewards[0]})
            self._settings = [replace(setting, reward_function=function) for function in rewards]
        else:
            setting = self.make_setting(**options)
            self._settings = [setting] * num_envs
        self.num_envs = num_envs
        self.setting = setting
        self.render_mode = render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**RacingEnv.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = setting.observation_space
        self.single_action_space = setting.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._copy, self._numbers_only = copy, numbers_only
        self._world: World | None = None
        self._drives: list[Drive] = []
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._over = np.zeros(num_envs, np.bool_)  # cars between two episodes
        self._observations: Readings = {
            name: np.zeros((num_envs, *space.shape), space.dtype) for name, space in setting.boxes.items()
        }

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, object] | None = None
    ) -> tuple[Readings | np.ndarray, _Infos]:
        """Start an episode of every car, or of those in ``options["reset_mask"]`` (bool, one for each car).

        ``options["start_m"]``: as in a single environment, for all. Raises ValueError for any other option.
        """
        options = dict(options or {})
        check_options(options, (*OPTIONS, "reset_mask"))
        mask = _mask(options.pop("reset_mask", None), self.num_envs)
        seeds = self._seeds(seed)
        if self._world is None:
            self._world = new_world(self.setting.physics)
            self._drives = [Drive(setting, self._world) for setting in self._settings]
        infos: _Infos = {}
        for number in np.flatnonzero(mask).tolist():
            if seeds[number] is not None or self._rngs[number] is None:
                self._rngs[number], _ = gymnasium.utils.seeding.np_random(seeds[number])
            infos = self._add_info(infos, self._visible_info(self._begin(number, options)), number)
        return self._seen(), infos

    def step(self, actions: np.ndarray) -> tuple[Readings | np.ndarray, np.ndarray, np.ndarray, np.ndarray, _Infos]:
        """One control step of every car. Raises ValueError for a wrong number of actions, or one that is not in the
        action space; then no car has moved."""
        if self._world is None or not all(drive.began for drive in self._drives):
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        waiting = self._over.copy()
        if waiting.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(f"reset cars {np.flatnonzero(waiting).tolist()}: their episodes are over")
        decoded = self._decoded(actions, waiting)
        for number, action in decoded.items():
            self._drives[number].take(action)
        if not waiting.all():
            self._world.step()
        # new episodes begin after the step: a car at its start must not move with the others
        rewards = np.zeros(self.num_envs, np.float64)
        terminated, truncated = np.zeros(self.num_envs, np.bool_), np.zeros(self.num_envs, np.bool_)
        infos: _Infos = {}
        episode_infos: list[_Infos] = []
        for number, drive in enumerate(self._drives):
            if waiting[number]:
                info = self._begin(number, {})
            else:
                outcome = drive.judge()
                rewards[number], terminated[number], truncated[number], info = outcome
                self._put(number, drive.observe())
                if self.autoreset_mode is AutoresetMode.SAME_STEP and (outcome.terminated or outcome.truncated):
                    infos = self._add_info(infos, self._final(number, outcome), number)
                    info = self._begin(number, {})
            episode_infos.append(self._visible_info(info))
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._over = terminated | truncated
        return self._seen(), rewards, terminated, truncated, self._merge(infos, episode_infos)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The last frame of each car, in render mode ``rgb_array``."""
        if self.render_mode is None or not self._drives:
            return None
        return tuple(picture(self.readings(number)) for number in range(self.num_envs))

    @property
    def exact(self) -> bool:
        """As in a single environment."""
        return is_pinned()

    def car(self, number: int) -> Competitor:
        """The car of sub-environment ``number`` in its present episode."""
        return self._drives[number].car

    def readings(self, number: int) -> Readings:
        """The present readings of one car: views, which the next step changes."""
        return {name: batch[number] for name, batch in self._observations.items()}

    def ground(self, number: int) -> PreparedTrack:
        """The track of sub-environment ``number`` in its present episode."""
        return self._drives[number].stage.ground

    def close_extras(self, **kwargs: Any) -> None:
        if self._world is not None:
            self._world.close()
        self._world, self._drives = None, []

    def _decoded(self, actions: Any, waiting: np.ndarray) -> dict[int, Action]:
        given = len(actions) if isinstance(actions, Sequence) or getattr(actions, "ndim", 0) > 0 else None
        if given != self.num_envs:
            found = "none" if given is None else given
            raise ValueError(f"{self.num_envs} cars need an array of as many actions, one for each, not {found}")
        decoded = {}
        for number, (drive, idle) in enumerate(zip(self._drives, waiting.tolist(), strict=True)):
            if not idle:
                try:
                    decoded[number] = drive.decode(actions[number])
                except ValueError as error:
                    raise ValueError(f"car {number}: {error}") from error
        return decoded

    def _begin(self, number: int, options: Mapping[str, Any]) -> EpisodeInfo:
        drive, rng = self._drives[number], self._rngs[number]
        assert rng is not None, "reset() draws one for each car"
        info = drive.begin(rng, options)
        self._over[number] = False
        self._put(number, drive.observe())
        return info

    def _visible_info(self, info: EpisodeInfo) -> _Infos:
        return {key: value for key, value in info.items() if not self._numbers_only or isinstance(value, int | float)}

    def _merge(self, infos: _Infos, episode_infos: list[_Infos]) -> _Infos:
        """The info of every car in Gymnasium's form: an array and a mask for each key, at once for speed."""
        for key in dict.fromkeys(chain.from_iterable(episode_infos)):
            values = [info.get(key) for info in episode_infos]
            given = np.array([key in info for info in episode_infos])
            if all(type(value) in (int, float, bool) for value in values):
                infos[key] = np.array(values, dtype=type(values[0]))
            else:
                infos[key] = np.full(self.num_envs, None, dtype=object)
                for number, value in enumerate(values):
                    infos[key][number] = value
            infos[f"_{key}"] = given
        return infos

    def _final(self, number: int, outcome: StepOutcome) -> _Infos:
        """The last observation and info of an episode."""
        last = {name: reading.copy() for name, reading in self.readings(number).items()}
        return {"final_obs": self.setting.present(last), "final_info": self._visible_info(outcome.info)}

    def _put(self, number: int, readings: Readings) -> None:
        for name, reading in readings.items():
            self._observations[name][number] = reading

    def _seen(self) -> Readings | np.ndarray:
        seen = self.setting.present(self._observations)
        return deepcopy(seen) if self._copy else seen

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + number for number in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{self.num_envs} cars need as many seeds, not {len(seed)}")
        return list(seed)


def _mask(mask: Any, count: int) -> np.ndarray:
    if mask is None:
        return np.ones(count, np.bool_)
    if not isinstance(mask, np.ndarray) or mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise ValueError(f"reset_mask must be a numpy array of {count} booleans, one of them true at least")
    return mask


class TimeTrialVectorEnv(RacingVectorEnv):
    """Many cars of ``Paddock/TimeTrial-v1``, with the same arguments."""

    make_setting = staticmethod(time_trial)


class ObjectAvoidanceVectorEnv(RacingVectorEnv):
    """Many cars of ``Paddock/ObjectAvoidance-v1``, with the same arguments; each has its own boxes."""

    make_setting = staticmethod(object_avoidance)


class HeadToHeadVectorEnv(RacingVectorEnv):
    """Many cars of ``Paddock/HeadToHead-v1``, with the same arguments; each has its own bots."""

    make_setting = staticmethod(head_to_head)
