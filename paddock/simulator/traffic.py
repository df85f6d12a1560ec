"""Decides contacts of cars on one track: the car at fault, and cars that pass through others."""

# Of two cars that touch, the one behind is at fault, measured the shorter way round (deepracer-simapp compares the
# normalised progress, which fails at the finish line). A crash stops the car at fault on the spot; other cars pass
# through a car that serves a penalty until the two are clear of each other again.

from collections.abc import Callable, Sequence

from .bots import Bots
from .car import Pose
from .competitor import Competitor
from .solids import cars_touch

_GAP_M = 0.1  # left free round a car that is put back


class Traffic:
    """Judges the contacts of a stage's ``competitors`` (the stage's own list) with each other and with its bots."""

    def __init__(self, length: float, competitors: list[Competitor], bots: Bots | None) -> None:
        self._length = length
        self._contestants = competitors
        self._bots = bots
        self._touching: set[tuple[int, int]] = set()  # pairs whose contact is judged already; bots count from -1 down

    def step(self) -> None:
        """The bots drive one control step; they see the cars where these were before it."""
        if self._bots is not None:
            length = self._length
            cars = []
            for competitor in self._contestants:
                if not (competitor.done or competitor.pausing):
                    referee = competitor.referee
                    middle = referee.odometer.metres - competitor.car.physics.nose_x
                    cars.append((middle % length, referee.odometer.place.offset))
            self._bots.step(cars)

    def rammed(self) -> Sequence[bool]:
        """For each competitor whether it ran into another car or a bot from behind. Bots in a new contact begin their
        pause."""
        competitors = self._contestants
        faults = [False] * len(competitors)
        for number, competitor in enumerate(competitors):
            if competitor.done:
                continue
            if self._bots is not None:
                faults[number] = self._meets_bots(number, competitor)
            for other in range(number + 1, len(competitors)):
                self._meets(number, other, faults)
        return faults

    def free_for(self, competitor: Callable[[], Competitor | None]) -> Callable[[Pose], bool]:
        """A test whether ``competitor()`` (None before it is added) may be put at a pose without touching a car or a
        bot."""

        def free(pose: Pose) -> bool:
            mine = competitor()
            others = [other.stands_at for other in self._contestants if other is not mine and not other.done]
            if self._bots is not None:
                others.extend(self._bots.poses)
            return not any(cars_touch(pose, other, _GAP_M) for other in others)

        return free

    def _meets_bots(self, number: int, competitor: Competitor) -> bool:
        """True where the competitor ran into a bot."""
        bots, fault = self._bots, False
        assert bots is not None
        pose = competitor.referee.pose
        for index, bot in enumerate(bots.bots):
            if not self._new_contact(number, -1 - index, pose, bot.pose) or competitor.pausing:
                continue
            # Noses against noses.
            ahead = bot.metres + competitor.car.physics.nose_x - competitor.referee.odometer.metres
            if self._wrap(ahead) >= 0.0:
                fault = True
            bots.pause(bot)
        return fault

    def _meets(self, number: int, other: int, faults: list[bool]) -> None:
        a, b = self._contestants[number], self._contestants[other]
        if b.done or not self._new_contact(number, other, a.referee.pose, b.referee.pose):
            return
        if a.pausing or b.pausing:
            return
        ahead = self._wrap(b.referee.odometer.metres - a.referee.odometer.metres)
        faults[number if ahead > 0.0 else other] = True

    def _new_contact(self, number: int, other: int, pose: Pose, other_pose: Pose) -> bool:
        pair = (number, other)
        if not cars_touch(pose, other_pose):
            self._touching.discard(pair)
            return False
        if pair in self._touching:
            return False
        self._touching.add(pair)
        return True

    def _wrap(self, metres: float) -> float:
        return (metres + self._length / 2) % self._length - self._length / 2
