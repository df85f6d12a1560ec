"""The training cars: the vectorised environment in stable-baselines3's interface."""

import gzip
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.hyperparameters import PPO
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL, other_direction
from paddock.simulator.action import CONTINUOUS, ActionSpace
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.envs.sb3 import SB3VecEnv
from paddock.simulator.referee import LAPS_DONE, Referee
from paddock.simulator.rewards import RewardFunction
from paddock.simulator.trace import LABELS, TIME_UP, Row, Trace
from paddock.simulator.vector import HeadToHeadVectorEnv, ObjectAvoidanceVectorEnv, TimeTrialVectorEnv

from .messages import EpisodeReport
from .observations import Sense, look
from .practice_starts import DRILL_STEPS, Drills, astray
from .road_state import LENGTH, road_state
from .spec import TrainerSpec
from .warm_up import row_space

KINDS = {
    TIME_TRIAL: TimeTrialVectorEnv,
    OBJECT_AVOIDANCE: ObjectAvoidanceVectorEnv,
    HEAD_TO_HEAD: HeadToHeadVectorEnv,
}
TRACE_ROWS = 6_000  # of an iteration's sim-trace; the newest episodes that fit
WORTH = 3.0
_LEAST_SHARE = 0.01  # of what is to come that one step counts, where the discount factor is 1 or nearly


class RewardScale:
    """The scale of rewards for PPO, learned from all rewards so far.

    PPO's policy and value share their features, so with large rewards the value's errors dominate what the features
    learn from. So rewards are scaled to make a lasting mean reward worth :data:`WORTH`. SAC weighs rewards against its
    entropy, whose coefficient its owner chooses, and gets them unscaled.
    """

    def __init__(self, discount: float) -> None:
        self._share = max(1.0 - discount, _LEAST_SHARE)
        self._paid, self._steps = 0.0, 0

    @property
    def factor(self) -> float:
        """The present factor; 1 until a reward was paid."""
        return WORTH * self._share * self._steps / self._paid if self._paid else 1.0

    def scaled(self, rewards: np.ndarray) -> np.ndarray:
        """The scaled rewards of one step of all cars, float32."""
        self._paid += float(np.abs(rewards, dtype=np.float64).sum())
        self._steps += len(rewards)
        return (rewards * self.factor).astype(np.float32)

    def state(self) -> dict[str, float]:
        return {"paid": self._paid, "steps": self._steps}

    def restore(self, state: dict[str, float]) -> None:
        self._paid, self._steps = float(state["paid"]), int(state["steps"])


def lap_limit_ms(track: TrackGeometry, space: ActionSpace) -> int:
    """The simulated time limit of a lap: 1.5 times the lap at the mean of the action space's speeds, and ten seconds;
    20 s to 4 minutes."""
    if space.kind == CONTINUOUS:
        speed = sum(space.speed) / 2.0
    else:
        speed = sum(speed for _, speed in space.actions) / len(space.actions)
    return int(min(max(1500.0 * track.length / max(speed, 0.1) + 10_000.0, 20_000.0), 240_000.0))


def fault_m(referee: Referee) -> float | None:
    """The place of a car's fault, in metres from the finish line; None without one."""
    failed = referee.end_reason not in (None, LAPS_DONE, TIME_UP)
    return referee.odometer.place.distance if failed else None


class Way(NamedTuple):
    """A track in the direction in which it is driven, its number among the training's tracks, and its look."""

    number: int
    track: TrackGeometry
    look: str

    @property
    def record(self) -> EpisodeReport:
        return {"track": self.number, "direction": self.track.direction}


def ways_of(spec: TrainerSpec, track: TrackGeometry) -> list[Way]:
    """The ways of a training, track by track. ``track``: its first, in its direction."""
    more = [(TrackGeometry.from_trusted_dict(one["track"]), one["look"]) for one in spec.more_tracks]
    shapes = [(track, spec.look), *more]
    ways = []
    for number, (shape, theme) in enumerate(shapes):
        ways.append(Way(number, shape, theme))
        if spec.alternate_direction:
            ways.append(Way(number, shape.in_direction(other_direction(shape.direction)), theme))
    return ways


class TrainingCars(SB3VecEnv):
    """Many cars in one world, each from a random place of the track until it leaves the track, has driven a lap or is
    out of time (the latter two are "truncated", as the end of a drill). Every second car drills known faults instead,
    see :mod:`.practice_starts`; drills are not recorded. Observations: rows, see :mod:`.observations`."""

    def __init__(
        self,
        spec: TrainerSpec,
        track: TrackGeometry,
        rewards: Sequence[RewardFunction],
        senses: list[Sense],
        seed: int,
        guided: bool = False,
    ) -> None:
        """``guided``: rows end with the state of the road."""
        space = ActionSpace.from_metadata(spec.metadata)
        ways = ways_of(spec, track)
        others = {way.number: way for way in reversed(ways) if way.number}
        env = KINDS[spec.race_type](
            len(rewards),
            autoreset_mode="Disabled",
            copy=False,
            track=track,
            direction=track.direction,
            metadata=spec.metadata,
            max_simulated_ms=max(lap_limit_ms(way.track, space) for way in ways),
            start="random",
            reward_function=list(rewards),
            theme=THEMES[spec.look],
            more_tracks=[(others[number].track, THEMES[others[number].look]) for number in sorted(others)],
            alternate_direction=spec.alternate_direction,
            randomise=spec.randomise,
            **spec.layout,
        )
        self._way_records = [way.record for way in ways] if len(ways) > 1 else []
        self._grounds = [ground for each in env.setting.ways for ground in each]
        self._senses, self._seed, self._guided = senses, seed, guided
        super().__init__(env, observation_space=row_space(senses, LENGTH if guided else 0))
        self.drills = Drills(len(ways))
        self.scale = RewardScale(spec.hyperparameters["discount_factor"]) if spec.algorithm == PPO else None
        self._drillers = np.arange(self.num_envs) % 2 == 1
        self._drilling = np.zeros(self.num_envs, np.bool_)  # in the present episode
        self.episodes: list[EpisodeReport] = []  # those that ended since the last :meth:`harvest`
        self._rows: list[list[Row]] = []
        self.episode = 0

    def reset(self) -> np.ndarray:
        """Start an episode of every car, from the seed of the training whatever the learner's is."""
        self.seed(self._seed)
        return cast("np.ndarray", super().reset())

    def step_wait(self) -> Any:
        """The outcome of a step with scaled rewards; ``earned`` has the function's own."""
        seen, rewards, done, infos = super().step_wait()
        return seen, rewards if self.scale is None else self.scale.scaled(rewards), done, infos

    def cut(self) -> np.ndarray:
        return self._drilling & (self._steps >= DRILL_STEPS)

    def again(self, cars: np.ndarray) -> Any:
        """Start episodes: drillers begin at a fault, if there was any."""
        readings: Any = None
        if (usual := cars & ~self._drillers).any():
            self._drilling[usual] = False
            readings = super().again(usual)
        for number in np.flatnonzero(cars & self._drillers).tolist():
            one = np.arange(self.num_envs) == number
            begin = {"start_m": partial(self._drill, number), "astray": partial(self._astray, number)}
            readings, _ = self.env.reset(options={"reset_mask": one, **begin})
        return readings

    def _drill(self, number: int, track: TrackGeometry, rng: np.random.Generator) -> float | None:
        start = self.drills.start_m(self._way_on(track), track, rng)
        self._drilling[number] = start is not None
        return start

    def _astray(self, number: int, rng: np.random.Generator) -> tuple[float, float]:
        return astray(rng) if self._drilling[number] else (0.0, 0.0)

    def _way_on(self, track: TrackGeometry) -> int:
        return next((number for number, ground in enumerate(self._grounds) if ground.track is track), 0)

    def look(self, readings: Any) -> np.ndarray:
        rows = look(self._senses, readings)
        if not self._guided:
            return rows
        states = [road_state(self.env.car(number)) for number in range(self.num_envs)]
        return np.concatenate([rows, np.array(states, np.float32)], axis=1)

    def harvest(self) -> tuple[list[EpisodeReport], bytes]:
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

    def ended(self, number: int, info: dict[str, object]) -> None:
        """Record an episode that is over, and its fault."""
        car = self.env.car(number)
        referee = car.referee
        if (metres := fault_m(referee)) is not None:
            self.drills.note(self._way_on(referee.track), metres)
        if self._drilling[number]:
            return
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
        if self._way_records:
            self.episodes[-1] |= self._way_records[self._grounds.index(self.env.ground(number))]
        self._rows.append(rows)
        self.episode += 1
