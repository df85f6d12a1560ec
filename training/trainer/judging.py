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
from paddock.simulator.envs.drive import Drive, StepOutcome
from paddock.simulator.envs.setting import Setting, head_to_head, object_avoidance, time_trial
from paddock.simulator.referee import LAPS_DONE
from paddock.simulator.rewards import RewardFunction
from paddock.simulator.trace import LABELS, TIME_UP

from .cars import Way, fault_m, lap_limit_ms, ways_of
from .drills import Fault
from .senses import Sense, look
from .spec import LAP_TIME, REWARD, TrainerSpec

_SETTINGS = {TIME_TRIAL: time_trial, OBJECT_AVOIDANCE: object_avoidance, HEAD_TO_HEAD: head_to_head}
_PLACES = 400  # of the newest drive that are told
PROBE_BEFORE_M, PROBE_BEYOND_M = 3.0, 1.0  # a probe is driven from before a fault to beyond it
_PROBE_STEPS = 90
_SAME_M = 0.5  # faults that lie nearer to each other are one

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
    dealt the trials in turn, and have at least one each.

    Where laps in a row are asked for, the first car of each way is the one that drives them: it waits behind its first
    lap until all trials are over, and drives on if none had a fault.

    A look at a car that nearly laps takes as long as the driving and learning since the last one. What it would show is
    mostly known before: :meth:`probe` drives over the places where the trials failed last."""

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
        self._told_ways = [one.told for one in of_trial] if spec.ways > 1 else [{}] * len(rewards)
        self._drives = [Drive(setting) for setting in self._settings]
        self._firsts = list(range(count)) if spec.stop_clean_laps else []  # whose laps in a row are asked for
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
        told = [trial | way for trial, way in zip(trials, self._told_ways, strict=True)]
        return Judgement(told, driving, confirmed, self._lengths, faults)

    def probe(self, act: Act) -> tuple[Fault, ...]:
        """Drive over the places where the last look ended with a fault, each from a stand shortly before it: where the
        car fails again, once for each trial that had failed there. With one of them a look would hardly show anything
        new."""
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
        """Which of these trials failed in the same place of the same way."""
        way, track = number % self._spec.ways, self._settings[number].ground.track
        for other, place in met:
            if other % self._spec.ways == way and _apart(track, metres, place) < _SAME_M:
                return other
        return None

    def _begin(self, number: int, start_m: float) -> None:
        """A trial at its start: with the same boxes and bots for every policy of this training, they are compared."""
        self._drives[number].begin(np.random.default_rng((self._spec.seed, number)), {"start_m": start_m})

    def _first_laps(self, act: Act) -> list[dict[str, Any]]:
        """Drive a lap of each trial, to its first fault; what each came to."""
        earned = [0.0] * len(self._drives)
        told: list[dict[str, Any]] = [{} for _ in self._drives]

        def over(number: int, outcome: StepOutcome) -> bool:
            earned[number] += outcome.reward
            drive = self._drives[number]
            lap_ms = drive.car.referee.laps[0].end_ms
            late = lap_ms is None and drive.car.referee.time_ms >= self._limits_ms[number]
            if not drive.car.done and lap_ms is None and not late:
                return False
            told[number] = _trial(drive, earned[number], late)
            return True

        self._drive(act, list(range(len(self._drives))), over)
        return told

    def _faults(self) -> list[tuple[int, float]]:
        """The numbers of the trials that have failed, and where."""
        found = [(number, fault_m(drive.car.referee)) for number, drive in enumerate(self._drives)]
        return [(number, metres) for number, metres in found if metres is not None]

    def _drive(self, act: Act, live: list[int], over: Callable[[int, StepOutcome], bool]) -> None:
        """Drive these cars on until their runs end, or until ``over`` says of a step that it was the last for now."""
        while live:
            seen = [self._drives[number].observe() for number in live]
            readings = {sense.name: np.stack([one[sense.name] for one in seen]) for sense in self._senses}
            outputs = act(look(self._senses, readings))
            going = []
            for number, output in zip(live, outputs, strict=True):
                drive = self._drives[number]
                drive.command(self._action(output))
                drive.world.step()
                outcome = drive.judge()
                if not over(number, outcome) and not drive.car.done:
                    going.append(number)
            live = going
            self._pulse()

    def _action(self, output: np.ndarray) -> Any:
        space = self._settings[0].actions
        return output if space.kind == CONTINUOUS else int(output.argmax())

    def close(self) -> None:
        """Free the worlds."""
        for drive in self._drives:
            drive.close()


def _apart(track: TrackGeometry, one: float, other: float) -> float:
    """Metres between two places of a track, the shorter way round."""
    apart = abs(one - other)
    return apart if track.is_open else min(apart, track.length - apart)


def _trial(drive: Drive, earned: float, late: bool) -> dict[str, Any]:
    """What a trial came to when its lap is done or its run over; ``late``: its time is up."""
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
    """The first ``steps`` of a drive as [x, y, yaw in radians, speed], metres and m/s to the millimetre; at most 400 of
    them."""
    rows = drive.car.rows[:steps]
    every = -(-len(rows) // _PLACES)
    return [
        [round(row.X, 3), round(row.Y, 3), round(float(np.deg2rad(row.yaw)), 3), round(row.throttle, 2)]
        for row in rows[::every]
    ]
