"""Several programs in the foreground as one: a common log, one that dies is started again, and all end together.

Programs are forks of this process (config/serving/forking.py), which therefore has one thread.
"""

import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import cycle
from math import inf
from selectors import EVENT_READ, DefaultSelector
from time import monotonic, time

from config.serving.forking import STOP_SIGNALS, fork
from core.jobs import DRAINED_STATUS
from core.logs.lines import as_printed, beginning, format_name

GRACE_S = 10.0
LONGEST_PAUSE_S = 60.0
LIVES_AFTER_S = 30.0  # one that has run for so long is well: its next death is the first again
TRIES_TO_LIVE = 5
CANNOT_RUN = os.EX_CONFIG  # how a vital program ends that would end again: it could not load what it is to run
SICK = b"Could not start worker processes"  # the log line of a worker that lives on without its pool
TURN_S = 0.1
DRAINED_PAUSE_S = 60.0  # until a drained worker is started again, which ends unless it was resumed
COLOURS = ("36", "33", "32", "35", "31", "34")  # of names on a terminal, as ECMA-48 numbers them: cyan, yellow, …
OURS = "paddock"  # stands before our own lines
_READ_BYTES = 65536
_IS_LOG = re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+Z [\w-]+\[\d+\] ")


@dataclass(eq=False)
class _Program:
    """``deaths``: in a row; ``due``: when it is started (again), on this machine's steady clock."""

    name: str
    work: Callable[[], object]
    colour: str = ""
    to_the_end: bool = False
    vital: bool = False
    inherited: Sequence[int] = ()
    once: bool = False
    pid: int | None = None
    deaths: int = 0
    due: float = 0.0
    started: float = 0.0
    sigterm_at: float | None = None
    is_sick: bool = False

    def tell_to_end(self) -> None:
        """SIGTERM once; SIGKILL to all that it has started when the time of grace is over."""
        if self.pid is None:
            return
        if self.sigterm_at is None:
            self.sigterm_at = monotonic()
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGTERM)
        elif monotonic() > self.sigterm_at + GRACE_S:
            self.kill()

    def kill(self) -> None:
        """End it with its children, which would go on holding its port or its jobs."""
        if self.pid is not None:
            with suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)

    def ended(self) -> int | None:
        """The exit status if it has ended since the last look (negative: a signal), and then nothing of it is left."""
        if self.pid is None:
            return None
        if os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            return None
        self.kill()  # before its number may be somebody else's
        _, status = os.waitpid(self.pid, 0)
        self.pid = None
        return os.waitstatus_to_exitcode(status)


@dataclass(eq=False)
class _Output:
    program: _Program
    pid: int
    file: int
    unfinished: bytes = b""

    def read(self) -> list[bytes] | None:
        """The lines that have come to their end; None at the end of all."""
        more = os.read(self.file, _READ_BYTES)
        if not more and not self.unfinished:
            return None
        *lines, self.unfinished = (self.unfinished + (more or b"\n")).split(b"\n")
        return lines


class Supervisor:
    """Runs programs until a SIGINT, SIGTERM or SIGHUP comes; then ends them all.

    A program that ends is started again after a pause that grows to :data:`LONGEST_PAUSE_S`, and so is a worker that
    logs that it could not start its processes; a drained worker is started each :data:`DRAINED_PAUSE_S` until it stays.
    Only a ``vital`` one that has ended with :data:`CANNOT_RUN`, or :data:`TRIES_TO_LIVE` times in a row soon after its
    start, ends all. Where SIGHUP is to replace the programs, each gets a successor, as the code is then, and ends.
    Nothing outlives the supervisor, not even after SIGKILL.
    """

    def __init__(self, *, replaces_on_sighup: bool = False) -> None:
        self._replaces_on_sighup, self._is_to_replace = replaces_on_sighup, False
        self._programs: list[_Program] = []
        self._outputs = DefaultSelector()
        self._colours = cycle(COLOURS)
        self._status: int | None = None  # not None: all are to end, and with what status
        self._culprit: str | None = None

    def add(
        self,
        name: str,
        work: Callable[[], object],
        *,
        needed_to_the_end: bool = False,
        vital: bool = False,
        inherited: Sequence[int] = (),
    ) -> None:
        """Add a program, whose process does ``work`` with the ``inherited`` files open. ``name`` stands before each
        line that it prints. One that is ``needed_to_the_end`` is ended after all others; without a ``vital`` one
        nothing runs."""
        colour = next((one.colour for one in self._programs if one.name == name), None) or next(self._colours)
        self._programs.append(_Program(name, work, colour, needed_to_the_end, vital, inherited))

    def run(self, beside: Callable[[], None] | None = None) -> tuple[str | None, int]:
        """Run to the end, with ``beside`` in a process whose lines are ours. Returns the vital program that could not
        live (None: a signal) and the exit status, negative for its signal."""
        for signum in STOP_SIGNALS:
            if signal.getsignal(signum) is not signal.SIG_IGN:  # as nohup leaves SIGHUP
                signal.signal(signum, self._stop)
        if self._replaces_on_sighup:
            signal.signal(signal.SIGHUP, self._ask_to_replace)
        if beside is not None:
            self._programs.append(_Program(OURS, beside, once=True))
        while True:
            if self._is_to_replace:
                self._replace_all()
            for program in list(self._programs):
                self._watch(program)
            if self._status is not None and not self._end_what_is_due():
                break
            self._print_lines(TURN_S)
        while self._print_lines(0):
            pass
        return self._culprit, self._status

    def _stop(self, signum: int, frame: object) -> None:
        if self._status is None:
            self._status = 128 + signum

    def _ask_to_replace(self, signum: int, frame: object) -> None:
        self._is_to_replace = True

    def _replace_all(self) -> None:
        self._is_to_replace = False
        running = [program for program in self._programs if program.pid is not None]
        self._programs += [replace(program, once=True, is_sick=True) for program in running]
        for program in running:
            program.pid = None

    def _watch(self, program: _Program) -> None:
        status = program.ended()
        if status is not None and self._status is None:
            self._note_death(program, status)
        if self._status is not None:
            return
        if program.pid is None and monotonic() >= program.due:
            self._start(program)
        elif program.is_sick:
            program.tell_to_end()

    def _note_death(self, program: _Program, status: int) -> None:
        if program.once:
            self._programs.remove(program)
            program.due = inf
            return
        if status == DRAINED_STATUS:
            program.deaths, program.due = 0, monotonic() + DRAINED_PAUSE_S
            return
        lived = monotonic() - program.started > LIVES_AFTER_S
        program.deaths = 1 if lived else program.deaths + 1
        if program.vital and (status == CANNOT_RUN or program.deaths >= TRIES_TO_LIVE):
            self._culprit, self._status = program.name, status
            return
        pause = min(2.0 ** min(program.deaths - 1, 10), LONGEST_PAUSE_S)
        program.due = monotonic() + pause
        how = f"signal {-status}" if status < 0 else f"exit status {status}"
        self._print(OURS, "", f"{program.name} ended by itself ({how}). It is started again in {pause:.0f} s.")

    def _start(self, program: _Program) -> None:
        program.started, program.sigterm_at, program.is_sick = monotonic(), None, False
        program.pid, reading = fork(program.work, program.inherited)
        self._outputs.register(reading, EVENT_READ, _Output(program, program.pid, reading))

    def _end_what_is_due(self) -> bool:
        """End every program that no running program needs. Whether any runs."""
        running = [program for program in self._programs if program.pid is not None]
        due = [program for program in running if not program.to_the_end] or running
        for program in due:
            program.tell_to_end()
        return bool(running)

    def _print_lines(self, wait_s: float) -> bool:
        """Print what there is; wait for the first line for at most ``wait_s``. Whether there was any."""
        ready = self._outputs.select(wait_s)
        for key, _ in ready:
            self._pass_on(key.data)
        return bool(ready)

    def _pass_on(self, output: _Output) -> None:
        lines, program = output.read(), output.program
        if lines is None:
            self._outputs.unregister(output.file)
            os.close(output.file)
            return
        for line in lines:
            self._print(program.name, program.colour, line.decode("utf-8", "replace"), output.pid)
            if SICK in line and program.pid == output.pid:
                program.is_sick = True

    def _print(self, name: str, colour: str, text: str, pid: int = 0) -> None:
        """Print lines. Those of the site's log begin with time and program; others get a beginning here."""
        begin = beginning(time(), pid or os.getpid(), name)
        try:
            for line in text.splitlines():
                if format_name() == "json":
                    print(as_printed(line, name, pid), flush=True)
                    continue
                head, line = _divided(line) if _IS_LOG.match(line) else (begin, f" {line}")
                print(
                    f"\033[{colour}m{head}\033[0m{line}" if colour and sys.stdout.isatty() else head + line, flush=True
                )
        except BrokenPipeError:  # the reader of our log has gone, which ends any program
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            self._stop(signal.SIGPIPE, None)


def _divided(line: str) -> tuple[str, str]:
    end = line.index("]") + 1
    return line[:end], line[end:]
