"""The evaluation of the policy after each update, without exploration."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL
from paddock.simulator.action import CONTINUOUS, ActionSpace
from paddock.simulator.camera.theme import THEMES
from paddock.simulator.envs.drive import Drive, StepOutcome
from paddock.simulator.envs.setting import Setting, head_to_head, object_avoidance, time_trial
from paddock.simulator.referee import LAPS_DONE
from paddock.simulator.rewards import RewardFunction
from paddock.simulator.trace import LABELS, TIME_UP

from .cars import Way, fault_m, lap_limit_ms, ways_of
from .messages import EpisodeReport
from .observations import Sense, look
from .practice_starts import Fault
from .spec import LAP_TIME, REWARD, TrainerSpec

_SETTINGS = {TIME_TRIAL: time_trial, OBJECT_AVOIDANCE: object_avoidance, HEAD_TO_HEAD: head_to_head}
_PLACES = 400  # reported of the newest drive
PROBE_BEFORE_M, PROBE_BEYOND_M = 3.0, 1.0  # a probe is driven from before a fault to beyond it
_PROBE_STEPS = 90
_SAME_M = 0.5  # faults that lie nearer to each other are one

Act = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Judgement:
    """The result of an evaluation. ``lap_ms``: the mean of the laps without a fault, None without one. ``confirmed``:
    it drove the required laps in a row without a fault from the finish line, on each way. ``lengths``: metres of a lap
    of each trial, where there are several tracks."""

    trials: list[EpisodeReport]
    driving: list[list[float]]
    confirmed: bool
    lengths: tuple[float, ...] = ()
    faults: tuple[Fault, ...] = ()

    @property
    def progress(self) -> float:
        return float(np.mean([trial["progress"] for trial in self.trials]))

    @property
    def reward(self) -> float:
        return float(np.mean([trial["reward"] for trial in self.trials]))

    @property
    def clean_laps(self) -> int:
        return sum(trial["lap_ms"] is not None for trial in self.trials)

    @property
    def lap_ms(self) -> int | None:
        times = [trial["lap_ms"] for trial in self.trials if trial["lap_ms"] is not None]
        return round(sum(times) / len(times)) if times else None

    @property
    def _pace(self) -> float:
        """Greater for a shorter lap time, which counts by the metre where there are several tracks."""
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
    """Drives a policy over the trials: one lap each, ended by the first fault, from places evenly spread over the
    track, the first from the finish line; on an open track all from the start. Several ways (tracks, directions) get
    the trials in turn, at least one each.

    The first car of each way drives the laps in a row, if there are any: after its first lap it waits until all trials
    are over, and continues if none had a fault. :meth:`probe` repeats only the places of the last faults, because a
    look at a car that nearly laps takes as long as the driving and learning since the last one."""

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
        laps = [spec.stop_clean_laps or 1 if number < count else 1 for number in range(len(rewards))]
        self._settings = [
            self._setting(one, reward, each) for one, reward, each in zip(of_trial, rewards, laps, strict=True)
        ]
        self._limits_ms = [lap_limit_ms(one.track, self._settings[0].actions) for one in of_trial]
        self._starts = []
        for number, one in enumerate(of_trial):
            on_it = -(-(len(rewards) - number % count) // count)
            apart = 0.0 if one.track.is_open else one.track.length / on_it
            self._starts.append(number // count * apart)
        self._lengths = tuple(one.track.length for one in of_trial) if spec.more_tracks else ()
        self._way_records = [one.record for one in of_trial] if spec.ways > 1 else [{}] * len(rewards)
        self._drives = [Drive(setting) for setting in self._settings]
        self._firsts = list(range(count)) if spec.stop_clean_laps else []  # that drive the laps in a row
        self._failed: list[tuple[int, float]] = []  # trials of the last look that had a fault, and where

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
        for number, start in enumerate(self._starts):
            self._begin(number, start)
        trials = self._first_laps(act)
        driving = _places(self._drives[0], trials[0]["steps"])
        confirmed = False
        if self._firsts and all(trial["lap_ms"] is not None for trial in trials):
            self._drive(act, [number for number in self._firsts if not self._drives[number].car.done], lambda *_: False)
            confirmed = all(self._drives[number].car.referee.end_reason == LAPS_DONE for number in self._firsts)
        self._failed = self._faults()
        faults = tuple((number % self._spec.ways, metres) for number, metres in self._failed)
        reported = [trial | way for trial, way in zip(trials, self._way_records, strict=True)]
        return Judgement(reported, driving, confirmed, self._lengths, faults)

    def probe(self, act: Act) -> tuple[Fault, ...]:
        """Drive over the places of the last look's faults, each from a stand shortly before it; the faults of now, once
        for each trial that had failed there."""
        met: list[tuple[int, float]] = []  # trials, and their places
        shared: dict[int, int] = {}  # trials that had failed in the place of this one
        begun: dict[int, float] = {}
        for number, metres in self._failed:
            if (other := self._near(number, metres, met)) is not None:
                shared[other] += 1
                continue
            met.append((number, metres))
            shared[number] = 1
            track, start = self._settings[number].ground.track, metres - PROBE_BEFORE_M
            self._begin(number, max(start, 0.0) if track.is_open else start % track.length)
            begun[number] = self._drives[number].car.referee.odometer.metres
        far = PROBE_BEFORE_M + PROBE_BEYOND_M

        def over(number: int, _: StepOutcome) -> bool:
            referee = self._drives[number].car.referee
            return referee.step >= _PROBE_STEPS or referee.odometer.metres - begun[number] >= far

        self._drive(act, list(begun), over)
        failed = [(number, fault_m(self._drives[number].car.referee)) for number in begun]
        return tuple(
            (number % self._spec.ways, metres)
            for number, metres in failed
            if metres is not None
            for _ in range(shared[number])
        )

    def _near(self, number: int, metres: float, met: list[tuple[int, float]]) -> int | None:
        """A trial that failed in the same place of the same way."""
        way, track = number % self._spec.ways, self._settings[number].ground.track
        for other, place in met:
            if other % self._spec.ways == way and _apart(track, metres, place) < _SAME_M:
                return other
        return None

    def _begin(self, number: int, start_m: float) -> None:
        """Start a trial, with the same boxes and bots for every policy of this training."""
        self._drives[number].begin(np.random.default_rng((self._spec.seed, number)), {"start_m": start_m})

    def _first_laps(self, act: Act) -> list[EpisodeReport]:
        """Drive a lap of each trial, to its first fault."""
        earned = [0.0] * len(self._drives)
        trials: list[EpisodeReport] = [{} for _ in self._drives]

        def over(number: int, outcome: StepOutcome) -> bool:
            earned[number] += outcome.reward
            drive = self._drives[number]
            lap_ms = drive.car.referee.laps[0].end_ms
            late = lap_ms is None and drive.car.referee.time_ms >= self._limits_ms[number]
            if not drive.car.done and lap_ms is None and not late:
                return False
            trials[number] = _trial(drive, earned[number], late)
            return True

        self._drive(act, list(range(len(self._drives))), over)
        return trials

    def _faults(self) -> list[tuple[int, float]]:
        found = [(number, fault_m(drive.car.referee)) for number, drive in enumerate(self._drives)]
        return [(number, metres) for number, metres in found if metres is not None]

    def _drive(self, act: Act, live: list[int], over: Callable[[int, StepOutcome], bool]) -> None:
        """Drive these cars until their runs end, or until ``over`` returns true for a step."""
        while live:
            seen = [self._drives[number].observe() for number in live]
            readings = {sense.name: np.stack([one[sense.name] for one in seen]) for sense in self._senses}
            outputs = act(look(self._senses, readings))
            going = []
            for number, output in zip(live, outputs, strict=True):
                drive = self._drives[number]
                drive.command(self._action(output))
                drive.stage.world.step()
                outcome = drive.judge()
                if not over(number, outcome) and not drive.car.done:
                    going.append(number)
            live = going
            self._pulse()

    def _action(self, output: np.ndarray) -> Any:
        space = self._settings[0].actions
        return output if space.kind == CONTINUOUS else int(output.argmax())

    def close(self) -> None:
        for drive in self._drives:
            drive.close()


def _apart(track: TrackGeometry, one: float, other: float) -> float:
    """Metres between two places of a track, the shorter way round."""
    apart = abs(one - other)
    return apart if track.is_open else min(apart, track.length - apart)


def _trial(drive: Drive, earned: float, late: bool) -> EpisodeReport:
    """The result of a trial when its lap is done or its run over; ``late``: its time is up."""
    car = drive.car
    referee = car.referee
    lap_ms = referee.laps[0].end_ms
    return {
        "reward": round(earned, 4),
        "progress": 100.0 if lap_ms is not None else round(min(max(referee.percent, 0.0), 100.0), 2),
        "status": LABELS[TIME_UP if late else car.status],
        "steps": referee.step + 1,
        "time_ms": lap_ms if lap_ms is not None else int(referee.time_ms),
        "lap_ms": lap_ms,
    }


def _places(drive: Drive, steps: int) -> list[list[float]]:
    """At most 400 of the first ``steps`` of a drive, as [x, y, yaw in radians, speed], metres and m/s."""
    rows = drive.car.rows[:steps]
    every = -(-len(rows) // _PLACES)
    return [
        [round(row.X, 3), round(row.Y, 3), round(float(np.deg2rad(row.yaw)), 3), round(row.throttle, 2)]
        for row in rows[::every]
    ]
