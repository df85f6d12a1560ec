"""Limits of one call of a reward function: time and printed characters.

A timer of processor time interrupts it: :func:`arm` sets it before the lock. Python notices it between two bytecode
instructions only, so the limits of the process end an endless call into C.
"""

import faulthandler
import io
import re
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, TypedDict

FILENAME = "<reward function>"  # in tracebacks
TICK_S = 0.1
LIMIT_S = 5.0  # DeepRacer on AWS: a validation may take 5 s
KEPT_CHARACTERS = 16_000  # of what it prints in its life
LAST_CHARACTERS = 2_000  # the newest, for the live page
PRINTED_CHARACTERS = 64_000  # in one call


class TooLong(BaseException):
    """The call has used up its time. No Exception, so that ``except Exception`` does not swallow it."""


class TooMuchPrinted(BaseException):
    """The call has printed more than anybody will read."""


class Halted(BaseException):
    """The training ends now: its time is up, or its owner stops it. No fault of the call."""


class Output(TypedDict):
    """New output of a reward function, see :meth:`Watch.news`."""

    kept: str
    last: str
    more: bool


class Watch(io.TextIOBase):
    """The time and the output of the present call, as ``sys.stdout``. Outside of a call nothing is limited or kept.

    ``printed``: the first ``KEPT_CHARACTERS``. ``limit_s``: seconds of processor time of a call. ``muted``: the output
    is not kept (the same text is loaded for another car). ``must_halt``: whether the training of the call ends now.
    """

    def __init__(self) -> None:
        self.limit_s = LIMIT_S
        self.must_halt: Callable[[], bool] = lambda: False
        self._ticks: int | None = None
        self.too_long_in: int | None = None
        self._room = 0
        self.printed = self._last = ""
        self.muted = self._news = self._more = False
        self._reported = 0  # characters of ``printed``

    def begin(self) -> None:
        self._room = PRINTED_CHARACTERS
        self._ticks = round(self.limit_s / TICK_S)
        self.too_long_in = None

    def end(self) -> None:
        self._ticks = None

    @property
    def is_in_call(self) -> bool:
        return self._ticks is not None

    def tick(self, _signal: int, frame: FrameType | None) -> None:
        """The timer. Raises Halted, or TooLong at every tick after the limit; Python swallows it in a ``__del__``, so
        ``too_long_in`` keeps the call's line at the time limit (0: unknown)."""
        if self._ticks is not None:
            if self.must_halt():
                raise Halted
            self._ticks -= 1
            if self._ticks <= 0:
                if self.too_long_in is None:
                    self.too_long_in = line_of_frame(frame)
                raise TooLong

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
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

    def news(self, *, over: bool = False) -> Output | None:
        """The output since the last call, or None. ``kept``: the next whole lines of ``printed`` (``over``: all).
        ``last``: the newest lines. ``more``: whether there was more than is kept."""
        whole = len(self.printed) if over or self._more else self.printed.rfind("\n") + 1
        if not self._news and whole <= self._reported:
            return None
        kept, self._reported, self._news = self.printed[self._reported : whole], max(whole, self._reported), False
        last = self._last
        if len(last) == LAST_CHARACTERS:  # the first of these lines has lost its beginning
            last = last.partition("\n")[2] or last
        return {"kept": kept, "last": last, "more": self._more}


class _Errors(io.TextIOBase):
    """``sys.stderr``: for :data:`watch` in a call (``traceback.print_exc``, ``logging``), else for operators."""

    def __init__(self, operators: Any) -> None:
        self._operators = operators

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        return watch.write(text) if watch.is_in_call else self._operators.write(text)

    def flush(self) -> None:
        if not watch.is_in_call:
            self._operators.flush()


def line_of_frame(frame: FrameType | None) -> int:
    while frame is not None and frame.f_code.co_filename != FILENAME:
        frame = frame.f_back
    return frame.f_lineno if frame is not None else 0


watch = Watch()

_INNERMOST_FIRST = "(most recent call first):"
_LINE = re.compile(rf'File "{FILENAME}", line (\d{{1,6}}) in')


def line_in(stderr: str) -> int | None:
    """The reward function's innermost line in the last report of :func:`arm`, or None. The text may be forged; only a
    number is returned."""
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
