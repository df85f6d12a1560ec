"""Ends one call of a reward function that computes or prints without end, at the line where it is.

A timer of processor time interrupts it: :func:`arm` sets it before the lock, which allows no timers. Python notices
between two of its own instructions, so one endless call into C outlives it, and the process's limits end that instead.
"""

from __future__ import annotations

import faulthandler
import io
import re
import signal
import sys
from types import FrameType

FILENAME = "<reward function>"  # in tracebacks
TICK_S = 0.1
LIMIT_S = 5.0  # DeepRacer on AWS: a validation may take 5 s
KEPT_CHARACTERS = 16_000  # of what it prints in its life
PRINTED_CHARACTERS = 64_000  # in one call


class TooLong(BaseException):
    """The call has used up its time. No Exception, so that ``except Exception`` does not swallow it."""


class TooMuchPrinted(BaseException):
    """The call has printed more than anybody will read."""


class Watch(io.TextIOBase):
    """The time and the prints of the present call; as ``sys.stdout`` it keeps the first of what is printed.

    ``printed``: the first ``KEPT_CHARACTERS`` of it. ``limit_s``: seconds of processor time that a call may take.
    Outside of a call nothing is limited, and nothing kept.
    """

    def __init__(self) -> None:
        self.limit_s = LIMIT_S
        self._ticks: int | None = None
        self._room = 0
        self.printed = ""

    def begin(self) -> None:
        """A call begins."""
        self._room = PRINTED_CHARACTERS
        self._ticks = round(self.limit_s / TICK_S)

    def end(self) -> None:
        """The call is over."""
        self._ticks = None

    def tick(self, _signal: int, _frame: FrameType | None) -> None:
        """The timer. Raises TooLong in whatever runs, and again at every tick, should that be caught."""
        if self._ticks is not None:
            self._ticks -= 1
            if self._ticks <= 0:
                raise TooLong

    def writable(self) -> bool:
        """It is there to be printed to."""
        return True

    def write(self, text: str) -> int:
        """Take what is printed. Raises TooMuchPrinted."""
        if self._ticks is not None:
            kept = KEPT_CHARACTERS - len(self.printed)
            if kept > 0:
                self.printed += text[:kept]
            self._room -= len(text)
            if self._room < 0:
                raise TooMuchPrinted
        return len(text)


watch = Watch()

_INNERMOST_FIRST = "(most recent call first):"
_LINE = re.compile(rf'File "{FILENAME}", line (\d{{1,6}}) in')


def line_in(stderr: str) -> int | None:
    """The reward function's innermost line in the last report that :func:`arm` had written; None if there is none.
    What it reads may come from a stranger; a number is all that it gives back."""
    found = _LINE.search(stderr, max(stderr.rfind(_INNERMOST_FIRST), 0))
    return int(found[1]) if found else None


def arm() -> None:
    """Start the timer and take over ``sys.stdout``. Once, when a process starts, before its lock.

    Crashes, the end of the process's own time and SIGUSR1 write the present line to stderr: :func:`line_in` finds it.
    """
    faulthandler.enable(all_threads=False)
    faulthandler.register(signal.SIGXCPU, all_threads=False, chain=True)
    faulthandler.register(signal.SIGUSR1, all_threads=False)
    signal.signal(signal.SIGPROF, watch.tick)
    signal.siginterrupt(signal.SIGPROF, False)  # no system call of a library ends early because of it
    signal.setitimer(signal.ITIMER_PROF, TICK_S, TICK_S)
    sys.stdout = watch
