"""Drives one car through successive episodes, for single and vector environments."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, NoReturn, NotRequired, TypedDict

import numpy as np

from paddock.errors import UserFault

from ..action import DISCRETE, Action
from ..competitor import Competitor
from ..randomisation import USUAL
from ..referee import LAPS_DONE
from ..results import LapDocument
from ..rewards import Objects, Params, reward_params
from ..stage import PreparedTrack, Simulation
from ..trace import TIME_UP
from ..world import World
from .setting import Readings, Setting

_LAYOUTS = 20  # seeds that an episode tries until random boxes have room


class EpisodeInfo(TypedDict):
    """The info of a step; ``laps`` and ``end_reason``: of an episode's last one."""

    status: str
    progress: float
    lap: int
    resets: int
    crashes: int
    time_ms: int
    is_success: bool
    laps: NotRequired[list[LapDocument]]
    end_reason: NotRequired[str]


class StepOutcome(NamedTuple):
    reward: float
    terminated: bool
    truncated: bool
    info: EpisodeInfo


OPTIONS = ("start_m", "astray")


def check_options(options: Mapping[str, Any] | None, known: Iterable[str]) -> None:
    """Raises ValueError for unknown options of ``reset``."""
    if unknown := [str(name) for name in options or {} if name not in known]:
        raise ValueError(f"reset has no option {', '.join(unknown)}; its options are {', '.join(known)}")


class NotCopied:
    """An environment, which cannot be copied or pickled, as its world lives in the memory of the physics engine."""

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        """Raises TypeError for ``copy.copy``, ``copy.deepcopy`` and ``pickle``, with the remedy."""
        raise TypeError(
            f"{type(self).__name__} cannot be copied or pickled, because its world belongs to this process. Make "
            "another environment with the same arguments, gymnasium.make(env.spec), and reset it with the same seed; "
            "give another process a function that makes its environment, as gymnasium.vector.AsyncVectorEnv takes it."
        )


class Drive(NotCopied):
    """One car on its own stage. A step is :meth:`command`, a step of the world, and :meth:`judge`."""

    def __init__(self, setting: Setting, world: World | None = None) -> None:
        """``world``: shared with other drives, whose cars this one neither meets nor sees."""
        self._setting = setting
        self._world = world
        self._stages: dict[int, Simulation] = {}  # one for each ground, in one world
        self._stage: Simulation | None = None
        self._car: Competitor | None = None
        self._objects = Objects(setting.ground.track)
        self._waypoints: list[tuple[float, float]] = []
        self._disturbance = USUAL
        self._episodes = 0

    @property
    def car(self) -> Competitor:
        assert self._car is not None, "no episode has begun"
        return self._car

    @property
    def stage(self) -> Simulation:
        assert self._stage is not None, "no episode has begun"
        return self._stage

    @property
    def began(self) -> bool:
        return self._car is not None

    def begin(self, rng: np.random.Generator, options: Mapping[str, Any] | None = None) -> EpisodeInfo:
        """Start an episode, which equals one in a new world to the last bit; its info.

        ``options``: ``start_m``, see :meth:`Setting.start_m`; ``astray``, a function of ``rng`` that returns an offset
        as a share of the road's width and a turn in radians, both to the left.

        Raises ValueError for any other option, UserFault ``boxes_do_not_fit``.
        """
        check_options(options, OPTIONS)
        setting = self._setting
        ground = setting.ground_of(self._episodes, rng)
        start_m = setting.start_m(rng, options or {}, ground)
        if self._stage is not None and self._stage.ground is not ground:
            self._stage.vacate()
        self._lay(rng, ground)
        self._episodes += 1
        track = ground.track
        self._objects = Objects(track, setting.rules.bot_speed_mps)
        self._waypoints = [(float(x), float(y)) for x, y in track.centre]
        self._car = self.stage.add(setting.sensors, start_m, setting.metadata.lidar_config)
        self._disturbance = setting.randomise.draw(rng, ground.theme) if setting.randomise else USUAL
        if astray := (options or {}).get("astray"):
            aside, turn = astray(rng)
            self._disturbance = replace(
                self._disturbance, aside=self._disturbance.aside + aside, turn=self._disturbance.turn + turn
            )
        if self._disturbance.moves_the_start:
            self._car.begin_at(self._disturbance.place(self._car.referee.pose, track.width_at(start_m % track.length)))
        return self._info()

    def from_the_first(self) -> None:
        """The next episode is the first again: it drives in the requested direction."""
        self._episodes = 0

    def _lay(self, rng: np.random.Generator, ground: PreparedTrack) -> None:
        """Clear the stage for the next episode; draw again while drawn boxes find no room."""
        setting, stage = self._setting, self._stages.get(id(ground))
        for attempts_left in reversed(range(_LAYOUTS)):
            rules = setting.episode_rules(rng)
            try:
                if stage is None:
                    world = self._stage.world if self._stage is not None else self._world
                    stage = self._stages[id(ground)] = Simulation(ground, rules, setting.physics, world)
                else:
                    stage.clear(rules)
                self._stage = stage
                return
            except UserFault:
                if not attempts_left or not setting.draws_layout:
                    raise

    def observe(self) -> Readings:
        return self._disturbance.observe(self.car.observe())

    def decode(self, action: Any) -> Action:
        """The command of an action of the action space; of a list also any form of one whole number. Raises ValueError
        for an invalid action, UserFault ``non_finite_action``."""
        actions = self._setting.actions
        if actions.kind == DISCRETE:
            index = _whole(action, actions.size)
            return Action(*actions.actions[index], index)
        return actions.decode(_pair(action), self.car.referee.step + 1)

    def command(self, action: Any) -> None:
        """Take an action of the action space; the world must then move by one step. Raises as :meth:`decode`."""
        self.take(self.decode(action))

    def take(self, action: Action) -> None:
        """The same for a decoded action."""
        assert self._stage is not None, "no episode has begun"
        self._stage.command((self._disturbance.act(action),))

    def judge(self) -> StepOutcome:
        """Judge the car after the world has moved, and let a penalty pass. Raises ValueError for a reward that is not
        finite."""
        car, stage = self.car, self.stage
        stage.judge()
        reward = car.reward = self._reward()
        info = self._info()
        while car.pausing and not car.done:
            stage.command((None,))  # the world stands
            car.reward = 0.0
            stage.judge()
        ended = car.referee.end_reason
        if ended is not None:
            info["laps"] = [lap.to_dict() for lap in car.lap_results()]
            info["end_reason"] = ended
        return StepOutcome(reward, ended is not None and ended != TIME_UP, ended == TIME_UP, info)

    def close(self) -> None:
        """Free the world unless it is shared; another episode may begin."""
        if self._world is None:
            for stage in self._stages.values():
                stage.close()
        self._stages.clear()
        self._stage = self._car = None

    def params(self) -> Params:
        """The parameters of the reward function in the present state."""
        car, stage = self.car, self.stage
        place = car.referee.odometer.place
        objects = self._objects.params(car.referee.pose, place.distance, stage.solids(car))
        return reward_params(car, self._waypoints, stage.ground.track.direction == "cw", objects)

    def _reward(self) -> float:
        reward = float(self._setting.reward_function(self.params()))
        if not math.isfinite(reward):
            raise ValueError(f"the reward function returned {reward}; it must return a finite number")
        return reward

    def _info(self) -> EpisodeInfo:
        car = self.car
        referee = car.referee
        return {
            "status": car.status,
            "progress": referee.percent,
            "lap": referee.lap.number,
            "resets": referee.resets,
            "crashes": referee.crashes,
            "time_ms": referee.time_ms,
            "is_success": referee.end_reason == LAPS_DONE,
        }


def _whole(action: Any, count: int) -> int:
    """The index into ``count`` actions. Raises ValueError with the possible values."""
    given = np.asarray(action)
    if given.size == 1 and given.dtype.kind in "iuf":
        value = given.reshape(-1)[0]
        if 0 <= value < count and value == int(value):
            return int(value)
    raise ValueError(f"an action must be a whole number from 0 to {count - 1}, not {action!r}")


def _pair(action: Any) -> np.ndarray:
    """Steering and speed as float32. Raises ValueError for anything but two numbers."""
    try:
        given = np.asarray(action, np.float32)
    except (TypeError, ValueError):
        given = np.empty(0, np.float32)
    if given.size != 2:
        raise ValueError(f"an action must be two numbers in [-1, 1], for steering and speed, not {action!r}")
    return given
