"""The look at the car after each update: how it drives when it does not explore."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL
from paddock.simulator.action import CONTINUOUS, ActionSpace
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.envs.drive import Drive
from paddock.simulator.envs.setting import Setting, head_to_head, object_avoidance, time_trial
from paddock.simulator.referee import LAPS_DONE
from paddock.simulator.rewards import RewardFunction
from paddock.simulator.trace import LABELS

from .cars import Way, fault_m, lap_limit_ms, ways_of
from .drills import Fault
from .senses import Sense, look
from .spec import LAP_TIME, REWARD, TrainerSpec

_SETTINGS = {TIME_TRIAL: time_trial, OBJECT_AVOIDANCE: object_avoidance, HEAD_TO_HEAD: head_to_head}
_PLACES = 400  # of the newest drive that are told

Act = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Judgement:
    """How a policy drove its trials. ``lap_ms``: the mean of the laps without a fault, None without one. ``confirmed``:
    it then drove as many laps in a row from the finish line without a fault as were asked for, on each way.
    ``lengths``: metres of a lap of each trial, where trials are on several tracks. ``faults``: where it failed."""

    trials: list[dict[str, Any]]
    driving: list[list[float]]
    confirmed: bool
    lengths: tuple[float, ...] = ()
    faults: tuple[Fault, ...] = ()

    @property
    def progress(self) -> float:
        """Mean percent of a lap."""
        return float(np.mean([trial["progress"] for trial in self.trials]))

    @property
    def reward(self) -> float:
        """Mean reward of a trial."""
        return float(np.mean([trial["reward"] for trial in self.trials]))

    @property
    def clean_laps(self) -> int:
        """Trials without a fault."""
        return sum(trial["lap_ms"] is not None for trial in self.trials)

    @property
    def lap_ms(self) -> int | None:
        """See the class."""
        times = [trial["lap_ms"] for trial in self.trials if trial["lap_ms"] is not None]
        return round(sum(times) / len(times)) if times else None

    @property
    def _pace(self) -> float:
        """The less time a lap takes, the greater. Laps of several tracks count by the metre: else who fails on the
        longest would be the fastest."""
        if self.lap_ms is None:
            return -np.inf
        if not self.lengths:
            return -float(self.lap_ms)
        clean = [
            (one["lap_ms"], metres) for one, metres in zip(self.trials, self.lengths, strict=True) if one["lap_ms"]
        ]
        return -float(np.mean([lap_ms / metres for lap_ms, metres in clean]))

    def key(self, metric: str) -> tuple[float, ...]:
        """Greater is better, by the metric; among equals more progress, and then shorter laps."""
        speed = self._pace
        if metric == REWARD:
            return (self.confirmed, self.reward)
        if metric == LAP_TIME:
            return (self.confirmed, self.clean_laps, speed if self.clean_laps else self.progress)
        return (self.confirmed, self.progress, speed)


class Judge:
    """Drives a policy over the trials: one lap each, ended by the first fault, from places that are evenly spread over
    the track; the first from the finish line. The simulator repeats itself, so trials from one place would be one: but
    on an open track every lap is from the start, and no other is worth a trial. Several ways (tracks, directions) are
    dealt the trials in turn, and have at least one each."""

    def __init__(
        self,
        spec: TrainerSpec,
        track: TrackGeometry,
        rewards: Sequence[RewardFunction],
        senses: list[Sense],
        pulse: Callable[[], None] = lambda: None,
    ) -> None:
        """``rewards``: one function for each trial. ``pulse`` is called after each control step."""
        self._pulse = pulse
        self._senses, self._spec = senses, spec
        ways = ways_of(spec, track)
        count = len(ways)
        of_trial = [ways[number % count] for number in range(len(rewards))]
        self._settings = [self._setting(one, reward, 1) for one, reward in zip(of_trial, rewards, strict=True)]
        self._starts = []
        for number, one in enumerate(of_trial):
            on_it = -(-(len(rewards) - number % count) // count)
            apart = 0.0 if one.track.is_open else one.track.length / on_it
            self._starts.append(number // count * apart)
        self._lengths = tuple(one.track.length for one in of_trial) if spec.more_tracks else ()
        self._told_ways = [one.told for one in of_trial] if spec.ways > 1 else [{}] * len(rewards)
        self._drives = [Drive(setting) for setting in self._settings]
        laps = spec.stop_clean_laps
        self._long = [Drive(self._setting(one, rewards[at], laps)) for at, one in enumerate(ways)] if laps else []

    def _setting(self, way: Way, reward: RewardFunction, laps: int) -> Setting:
        track = way.track
        space = ActionSpace.from_metadata(self._spec.metadata)
        return _SETTINGS[self._spec.race_type](
            track=track,
            direction=track.direction,
            metadata=self._spec.metadata,
            laps=laps,
            max_simulated_ms=laps * lap_limit_ms(track, space),
            reward_function=reward,
            theme=THEMES[way.look],
            **self._spec.layout,
        )

    def look(self, act: Act) -> Judgement:
        """Drive the trials, and the laps in a row once all trials are clean."""
        told = self._drive(act, self._drives, self._starts)
        faults = self._faults(self._drives)
        confirmed = False
        if self._long and all(trial["lap_ms"] is not None for trial in told):
            laps = self._drive(act, self._long, [0.0] * len(self._long))
            confirmed = all(each["lap_ms"] is not None for each in laps)
            faults = self._faults(self._long)
        told = [trial | way for trial, way in zip(told, self._told_ways, strict=True)]
        return Judgement(told, _places(self._drives[0]), confirmed, self._lengths, faults)

    def _faults(self, drives: list[Drive]) -> tuple[Fault, ...]:
        """Where the cars of these drives have failed: the first of each way come first, then the second, ..."""
        found = [(number % self._spec.ways, fault_m(drive.car.referee)) for number, drive in enumerate(drives)]
        return tuple((way, metres) for way, metres in found if metres is not None)

    def _drive(self, act: Act, drives: list[Drive], starts: list[float]) -> list[dict[str, Any]]:
        """Drive each from its start to its end."""
        # the same boxes and bots for every policy of this training: they are compared
        for number, (drive, start) in enumerate(zip(drives, starts, strict=True)):
            drive.begin(np.random.default_rng((self._spec.seed, number)), {"start_m": start})
        earned = [0.0] * len(drives)
        told: list[dict[str, Any]] = [{} for _ in drives]
        live = list(range(len(drives)))
        while live:
            seen = [drives[number].observe() for number in live]
            readings = {sense.name: np.stack([one[sense.name] for one in seen]) for sense in self._senses}
            outputs = act(look(self._senses, readings))
            going = []
            for number, output in zip(live, outputs, strict=True):
                drive = drives[number]
                drive.command(self._action(output))
                drive.world.step()
                outcome = drive.judge()
                earned[number] += outcome.reward
                if outcome.terminated or outcome.truncated:
                    told[number] = _trial(drive, earned[number])
                else:
                    going.append(number)
            live = going
            self._pulse()
        return told

    def _action(self, output: np.ndarray) -> Any:
        space = self._settings[0].actions
        return output if space.kind == CONTINUOUS else int(output.argmax())

    def close(self) -> None:
        """Free the worlds."""
        for drive in (*self._drives, *self._long):
            drive.close()


def _trial(drive: Drive, earned: float) -> dict[str, Any]:
    car = drive.car
    referee = car.referee
    clean = referee.end_reason == LAPS_DONE
    return {
        "reward": round(earned, 4),
        "progress": 100.0 if clean else round(min(max(referee.percent, 0.0), 100.0), 2),
        "status": LABELS[car.status],
        "steps": len(car.rows),
        "time_ms": int(referee.time_ms),
        "lap_ms": int(referee.time_ms) if clean else None,
    }


def _places(drive: Drive) -> list[list[float]]:
    """The drive as [x, y, yaw in radians, speed], metres and m/s to the millimetre; at most 400 of them."""
    rows = drive.car.rows
    every = -(-len(rows) // _PLACES)
    return [
        [round(row.X, 3), round(row.Y, 3), round(float(np.deg2rad(row.yaw)), 3), round(row.throttle, 2)]
        for row in rows[::every]
    ]
