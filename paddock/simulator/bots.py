"""Kinematic bot cars, which follow the lane centres at constant speed by seed and clock alone."""

# Source: deepracer-simapp, agent_ctrl/bot_cars_agent_ctrl.py. Draws come from :class:`random.Random`, as for boxes (see
# :mod:`paddock.simulator.layout`).

import math
import random
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import INNER, LANES, RaceRules, penalty_steps

from .car import Pose
from .layout import other_lane, start_places
from .solids import car

FOLLOW_M = 0.5  # least distance between the middles of a bot and a car before it in its lane
CLEAR_M = 1.5  # free distance of the other lane before and behind that a lane change needs
BESIDE_M = 0.3  # distance across the road at which two cars pass each other
_LOOK_M = 1.2  # range ahead along the centre line: FOLLOW_M, a stride, and the bend of a hairpin
_SAMPLE_M = 0.05
_STILL_M = 1e-3  # a lane may stand still inside a corner

_Sample = tuple[float, float, float, float, float]


class LanePaths:
    def __init__(self, track: TrackGeometry) -> None:
        self.length = track.length
        self._count = max(8, math.ceil(track.length / _SAMPLE_M))
        self._per_m = self._count / track.length
        self._samples = {lane: _samples(track, lane, self._count) for lane in LANES}
        self._driven = {lane: _driven(samples) for lane, samples in self._samples.items()}

    def at(self, metres: float, lane: str) -> _Sample:
        """(x, y, cos and sin of the heading, offset to the left of the centre line) on a lane's centre; ``metres``
        along the track's centre line, in [0, length)."""
        share = metres * self._per_m
        index = int(share)
        share -= index
        samples = self._samples[lane]
        ax, ay, acos, asin, aside = samples[index]
        bx, by, bcos, bsin, bside = samples[index + 1]
        return (
            ax + share * (bx - ax),
            ay + share * (by - ay),
            acos + share * (bcos - acos),
            asin + share * (bsin - asin),
            aside + share * (bside - aside),
        )

    def stretch(self, metres: float, lane: str) -> float:
        """Metres driven in a lane for a metre of the track's centre line there."""
        driven = self._driven[lane]
        index = int(metres * self._per_m)
        return (driven[index + 1] - driven[index]) * self._per_m

    def ahead(self, metres: float, lane: str, way: float) -> float:
        """Metres along the centre line after driving ``way`` metres of the lane from ``metres`` on."""
        driven = self._driven[lane]
        share = metres * self._per_m
        index = int(share)
        reached = driven[index] + (share - index) * (driven[index + 1] - driven[index]) + way
        lap = driven[self._count]
        if reached >= lap:
            reached -= lap
        index = bisect_right(driven, reached) - 1
        return (index + (reached - driven[index]) / (driven[index + 1] - driven[index])) / self._per_m


def _samples(track: TrackGeometry, lane: str, count: int) -> list[_Sample]:
    """Even samples round the lap, the first two repeated at its end. The heading is that from the sample before to the
    one after."""
    metres = np.arange(count) * (track.length / count)
    left, right = track.half_widths_along(metres)
    sides = left / 2 if (lane == INNER) == (track.direction == "ccw") else -right / 2
    points = track.points_at(metres, sides)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.maximum(np.sqrt((along * along).sum(axis=1)), _STILL_M)[:, None]
    samples = [tuple(row) for row in np.column_stack((points, along, sides)).tolist()]
    return [*samples, *samples[:2]]


def _driven(samples: Sequence[_Sample]) -> list[float]:
    """Metres driven from the first sample to each."""
    points = np.array(samples)[:, :2]
    steps = np.diff(points, axis=0)
    return [0.0, *np.cumsum(np.maximum(np.sqrt((steps * steps).sum(axis=1)), _STILL_M)).tolist()]


@dataclass(slots=True)
class Bot:
    """One bot. ``metres`` of its middle along the centre line in [0, length), ``offset`` to the left of it."""

    metres: float
    lane: str  # of a lane change the new one
    draw: random.Random
    pause_steps: int = 0
    offset: float = 0.0
    left: float = 0.0  # remaining share of a lane change
    turn: float = 0.0  # heading relative to the lane's in a lane change
    pose: Pose = field(default_factory=lambda: Pose(0.0, 0.0, 0.0))
    before: str | None = None  # the lane that it is leaving
    changed_m: float = 0.0  # driven since the lane change began
    until_change: int = 0


class Bots:
    """All bots of a race. They yield to what stands or drives slower before them, and change only into a free lane. A
    bot pauses after a contact."""

    def __init__(self, paths: LanePaths, rules: RaceRules, control_hz: float) -> None:
        """Raises UserFault ``bots_do_not_fit`` for a track that is too short."""
        self._paths = paths
        self._stride = rules.bot_speed_mps / control_hz
        self._change_m = rules.bot_lane_change_m
        times = rules.bot_lane_change_least_ms, rules.bot_lane_change_most_ms
        self._change_ms = times if rules.bot_lane_changes else None
        self._control_hz = control_hz
        self._pause_steps = penalty_steps(rules.bot_pause_ms, control_hz)
        lane = LANES[int(2 * random.Random(f"bots {rules.seed}").random())]
        self.bots: list[Bot] = []
        for number, metres in enumerate(start_places(paths.length, rules.bots)):
            bot = Bot(metres, lane, random.Random(f"bot {number} {rules.seed}"))
            bot.until_change = self._interval(bot)
            self._pose(bot)
            self.bots.append(bot)
            lane = other_lane(lane)
        self._renew()

    @property
    def poses(self) -> tuple[Pose, ...]:
        return tuple(bot.pose for bot in self.bots)

    def pause(self, bot: Bot) -> None:
        bot.pause_steps = max(bot.pause_steps, self._pause_steps)

    def step(self, cars: Iterable[tuple[float, float]]) -> None:
        """One control step. ``cars``: metres of the middle along the centre line in [0, length) and offset of each car
        that serves no penalty."""
        bots = self.bots
        # the places before anybody moves; a bot that changes lanes is in both
        taken = [(bot.metres, bot.offset) for bot in bots]
        others = [*taken, *cars]
        for number, bot in enumerate(bots):
            if bot.pause_steps:
                bot.pause_steps -= 1
            else:
                self._move(bot, number, others)
        self._renew()

    def _move(self, bot: Bot, number: int, others: Sequence[tuple[float, float]]) -> None:
        length, metres, side = self._paths.length, bot.metres, bot.offset
        stretch = self._paths.stretch(metres, bot.lane)
        ahead = self._stride * math.cos(bot.turn)
        for index, (other_m, other_side) in enumerate(others):
            gap = (other_m - metres) % length
            if gap < _LOOK_M and -BESIDE_M < other_side - side < BESIDE_M and index != number:
                if gap == 0.0 and index > number:
                    continue  # two bots abreast to the last bit must not wait for each other
                room = gap * stretch - FOLLOW_M
                if room < ahead:
                    ahead = room if room > 0.0 else 0.0
        if self._change_ms is not None:
            self._change_lane(bot, number, ahead, others)
        if ahead > 0.0:
            if bot.before is None:
                bot.metres = self._paths.ahead(metres, bot.lane, ahead)
            else:  # between the lanes
                other = self._paths.stretch(metres, bot.before)
                bot.metres = (metres + ahead / (stretch + bot.left * (other - stretch))) % length
            self._pose(bot)

    def _change_lane(self, bot: Bot, number: int, ahead: float, others: Sequence[tuple[float, float]]) -> None:
        if bot.before is not None:
            bot.changed_m += ahead
            if bot.changed_m >= self._change_m:
                bot.before = None
                bot.until_change = self._interval(bot)
            return
        bot.until_change -= 1
        if bot.until_change <= 0 and self._clear(bot, number, other_lane(bot.lane), others):
            bot.before, bot.lane, bot.changed_m, bot.left = bot.lane, other_lane(bot.lane), 0.0, 1.0

    def _clear(self, bot: Bot, number: int, lane: str, others: Sequence[tuple[float, float]]) -> bool:
        """Whether ``lane`` is free near the bot, also of bots that are changing into it."""
        length = self._paths.length
        side = self._paths.at(bot.metres, lane)[4]
        for index, (other_m, other_side) in enumerate(others):
            if index == number:
                continue
            gap = (other_m - bot.metres + CLEAR_M) % length
            if gap < 2 * CLEAR_M:
                changing = index < len(self.bots) and self.bots[index].before is not None
                if changing or abs(other_side - side) < BESIDE_M:
                    return False
        return True

    def _interval(self, bot: Bot) -> int:
        """Control steps until the next lane change."""
        if self._change_ms is None:
            return 0
        least, most = self._change_ms
        return penalty_steps(round(least + bot.draw.random() * (most - least)), self._control_hz)

    def _pose(self, bot: Bot) -> None:
        x, y, cos, sin, side = self._paths.at(bot.metres, bot.lane)
        bot.turn = 0.0
        if bot.before is not None:
            from_x, from_y, from_cos, from_sin, from_side = self._paths.at(bot.metres, bot.before)
            share = bot.changed_m / self._change_m
            bot.left = left = 1.0 - share * share * (3.0 - 2.0 * share)
            bot.turn = math.atan(6.0 * share * (1.0 - share) / self._change_m * (side - from_side))
            x += left * (from_x - x)
            y += left * (from_y - y)
            cos += left * (from_cos - cos)
            sin += left * (from_sin - sin)
            side += left * (from_side - side)
        bot.offset = side
        bot.pose = Pose(x, y, math.remainder(math.atan2(sin, cos) + bot.turn, 2.0 * math.pi))

    def _renew(self) -> None:
        self.solids = tuple(car(*bot.pose) for bot in self.bots)
