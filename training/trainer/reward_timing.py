"""The time of reward function calls, and the end of a training between two calls.

A function that takes 0.2 s would delay the end of a training for minutes. :class:`Pace` measures every call and raises
``Halted`` between two; within a call the timer of :mod:`training.rewards.sandbox.call_limits` does the same.
"""

import time
from collections.abc import Callable

from paddock.errors import UserFault
from paddock.simulator.rewards import Params, RewardFunction
from training.rewards.sandbox.call_limits import Halted
from training.rewards.sandbox.function import name_state

LOOK_EVERY_S = 0.1  # whether the training ends
LEFT_S = 1.0  # of the processor, for an evaluation that is under way at the end
_SHORT_DRIVE = 50  # steps, of a car that has learned nothing


class Pace:
    """Counts calls and their seconds, and ends the training in time. ``must_end``: whether it ends, by its limit or
    a request. ``pulse`` is called about every :data:`LOOK_EVERY_S` of calls."""

    def __init__(self, must_end: Callable[[], bool], pulse: Callable[[], None]) -> None:
        self._must_end, self._pulse = must_end, pulse
        self.calls, self.seconds = 0, 0.0
        self._looked_at = time.monotonic()
        self._leave_at: float | None = None  # by the processor's time of this process
        self._left_s = 0.0

    @property
    def call_ms(self) -> float | None:
        """Milliseconds of a call, on the average; None before the first."""
        return round(1000.0 * self.seconds / self.calls, 3) if self.calls else None

    def leaves_time(self, cars: int) -> bool:
        """Whether an evaluation of so many cars can give a result within :data:`LEFT_S`."""
        return (self.call_ms or 0.0) * cars * _SHORT_DRIVE < 1000.0 * LEFT_S

    def allow(self, seconds: float) -> None:
        """Allow so many seconds of the processor after the training's end is due."""
        self._left_s = seconds
        if self._leave_at is not None:
            self._leave_at = time.process_time() + seconds

    def must_halt(self) -> bool:
        """Whether the driving must end within a step."""
        if self._leave_at is None and self._must_end():
            self._leave_at = time.process_time() + self._left_s
        return self._leave_at is not None and time.process_time() >= self._leave_at

    def measured(self, function: RewardFunction) -> RewardFunction:

        def call(params: Params) -> float:
            began = time.thread_time()
            try:
                return function(params)
            except UserFault as fault:
                self._look()  # what it raised may have come of its interruption
                name_state(fault, params)
                raise
            finally:
                self.calls += 1
                self.seconds += time.thread_time() - began
                if time.monotonic() - self._looked_at >= LOOK_EVERY_S:
                    self._look()

        return call

    def _look(self) -> None:
        self._looked_at = time.monotonic()
        self._pulse()
        if self.must_halt():
            raise Halted
