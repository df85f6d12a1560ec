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
from collections.abc import Callable
from types import FrameType
from typing import Any

FILENAME = "<reward function>"  # in tracebacks
TICK_S = 0.1
LIMIT_S = 5.0  # DeepRacer on AWS: a validation may take 5 s
KEPT_CHARACTERS = 16_000  # of what it prints in its life
LAST_CHARACTERS = 2_000  # the newest of it, for whoever looks on
PRINTED_CHARACTERS = 64_000  # in one call


class TooLong(BaseException):
    """The call has used up its time. No Exception, so that ``except Exception`` does not swallow it."""


class TooMuchPrinted(BaseException):
    """The call has printed more than anybody will read."""


class Halted(BaseException):
    """The training ends now: its time is up, or its owner stops it. No fault of the call."""


class Watch(io.TextIOBase):
    """The time and the prints of the present call; as ``sys.stdout`` it keeps the first of what is printed, and the
    newest.

    ``printed``: the first ``KEPT_CHARACTERS`` of it. ``limit_s``: seconds of processor time that a call may take.
    ``muted``: what is printed is not kept (the same text is loaded for one more car). Outside of a call nothing is
    limited, and nothing kept. ``must_halt``: whether the training that the call belongs to ends now; the timer asks
    it, too.
    """

    def __init__(self) -> None:
        self.limit_s = LIMIT_S
        self.must_halt: Callable[[], bool] = lambda: False
        self._ticks: int | None = None
        self.too_long_in: int | None = None
        self._room = 0
        self.printed = self._last = ""
        self.muted = self._news = self._more = False
        self._told = 0  # of what is kept

    def begin(self) -> None:
        """A call begins."""
        self._room = PRINTED_CHARACTERS
        self._ticks = round(self.limit_s / TICK_S)
        self.too_long_in = None

    def end(self) -> None:
        """The call is over."""
        self._ticks = None

    @property
    def is_in_call(self) -> bool:
        """Whether a call has begun and is not over."""
        return self._ticks is not None

    def tick(self, _signal: int, frame: FrameType | None) -> None:
        """The timer. Raises TooLong in whatever runs, and again at every tick, should that be caught; Python itself
        swallows it in a ``__del__``, so ``too_long_in`` says in which line of the call the time was up (0: unknown).
        Raises Halted where :attr:`must_halt`."""
        if self._ticks is not None:
            if self.must_halt():
                raise Halted
            self._ticks -= 1
            if self._ticks <= 0:
                if self.too_long_in is None:
                    self.too_long_in = _line_of(frame)
                raise TooLong

    def writable(self) -> bool:
        """It is there to be printed to."""
        return True

    def write(self, text: str) -> int:
        """Take what is printed. Raises TooMuchPrinted."""
        if self._ticks is not None:
            if not self.muted:
                self._keep(text)
            self._room -= len(text)
            if self._room < 0:
                raise TooMuchPrinted
        return len(text)

    def _keep(self, text: str) -> None:
        kept = KEPT_CHARACTERS - len(self.printed)
        if kept > 0:
            self.printed += text[:kept]
        self._more = self._more or len(text) > kept
        self._last = (self._last + text[-LAST_CHARACTERS:])[-LAST_CHARACTERS:]
        self._news = True

    def news(self, *, over: bool = False) -> dict[str, Any] | None:
        """What was printed since the last time this was asked; None for nothing. ``kept``: the next whole lines of
        ``printed`` (``over``: also one that has no end). ``last``: the newest lines. ``more``: whether there was more
        than is kept."""
        whole = len(self.printed) if over or self._more else self.printed.rfind("\n") + 1
        if not self._news and whole <= self._told:
            return None
        kept, self._told, self._news = self.printed[self._told : whole], max(whole, self._told), False
        last = self._last
        if len(last) == LAST_CHARACTERS:  # the first of these lines has lost its beginning
            last = last.partition("\n")[2] or last
        return {"kept": kept, "last": last, "more": self._more}


class _Errors(io.TextIOBase):
    """``sys.stderr``: in a call it is printed to :data:`watch`, such as by ``traceback.print_exc`` and ``logging``;
    outside of calls it is for operators."""

    def __init__(self, operators: Any) -> None:
        self._operators = operators

    def writable(self) -> bool:
        """It is there to be printed to."""
        return True

    def write(self, text: str) -> int:
        """Take what is printed. Raises TooMuchPrinted in a call."""
        return watch.write(text) if watch.is_in_call else self._operators.write(text)

    def flush(self) -> None:
        """Nothing of a call waits; what is for operators goes to them."""
        if not watch.is_in_call:
            self._operators.flush()


def _line_of(frame: FrameType | None) -> int:
    while frame is not None and frame.f_code.co_filename != FILENAME:
        frame = frame.f_back
    return frame.f_lineno if frame is not None else 0


watch = Watch()

_INNERMOST_FIRST = "(most recent call first):"
_LINE = re.compile(rf'File "{FILENAME}", line (\d{{1,6}}) in')


def line_in(stderr: str) -> int | None:
    """The reward function's innermost line in the last report that :func:`arm` had written; None if there is none.
    What it reads may come from a stranger; a number is all that it gives back."""
    found = _LINE.search(stderr, max(stderr.rfind(_INNERMOST_FIRST), 0))
    return int(found[1]) if found else None


def arm() -> None:
    """Start the timer and take over ``sys.stdout`` and ``sys.stderr``. Once, when a process starts, before its lock.

    Crashes, the end of the process's own time and SIGUSR1 write the present line to stderr: :func:`line_in` finds it.
    """
    faulthandler.enable(all_threads=False)
    faulthandler.register(signal.SIGXCPU, all_threads=False, chain=True)
    faulthandler.register(signal.SIGUSR1, all_threads=False)
    signal.signal(signal.SIGPROF, watch.tick)
    signal.siginterrupt(signal.SIGPROF, False)  # no system call of a library ends early because of it
    signal.setitimer(signal.ITIMER_PROF, TICK_S, TICK_S)
    sys.stdout, sys.stderr = watch, _Errors(sys.stderr)
