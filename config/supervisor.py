"""Several programs in the foreground as one: a common log, one that dies is started again, and all end together.

Programs are started by ``subprocess`` and not by a fork of this process, which has threads.
"""

from __future__ import annotations

import ctypes
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import cycle
from time import monotonic

GRACE_S = 10.0
LONGEST_PAUSE_S = 60.0
LIVES_AFTER_S = 30.0  # one that has run for so long is well: its next death is the first again
TRIES_TO_LIVE = 5
SICK = b"Could not start worker processes"  # what a worker says that lives on without its pool
TURN_S = 0.1
COLOURS = ("36", "33", "32", "35", "31", "34")  # of names on a terminal, as ECMA-48 numbers them: cyan, yellow, …
_PR_SET_PDEATHSIG = 1
# Ask the kernel to end this process with its parent, and become the program.
_BOUND = (
    "import ctypes, os, sys\n"
    "if sys.platform == 'linux':\n"
    "    ctypes.CDLL(None).prctl(1, 15, 0, 0, 0)\n"  # PR_SET_PDEATHSIG, SIGTERM
    "if os.getppid() != int(sys.argv[1]): sys.exit(1)\n"
    "os.execvp(sys.argv[2], sys.argv[2:])"
)


@dataclass(eq=False)
class _Program:
    """One of them. ``deaths``: in a row; ``due``: when it is started (again), on this machine's steady clock."""

    name: str
    command: Sequence[str]
    environment: dict[str, str]
    colour: str
    to_the_end: bool
    vital: bool
    process: subprocess.Popen | None = None
    deaths: int = 0
    due: float = 0.0
    started: float = 0.0
    told_at: float | None = None
    is_sick: bool = False

    def tell_to_end(self) -> None:
        """SIGTERM once; SIGKILL to all that it has started when the time of grace is over."""
        if self.process is None:
            return
        if self.told_at is None:
            self.told_at = monotonic()
            with suppress(ProcessLookupError):
                os.kill(self.process.pid, signal.SIGTERM)
        elif monotonic() > self.told_at + GRACE_S:
            self.kill()

    def kill(self) -> None:
        """End it with its children, which would go on holding its port or its jobs."""
        if self.process is not None:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)

    def ended(self) -> int | None:
        """The exit status if it has ended since the last look (negative: a signal), and then nothing of it is left."""
        if self.process is None:
            return None
        flags = os.WEXITED | os.WNOHANG | os.WNOWAIT
        if os.waitid(os.P_PID, self.process.pid, flags) is None:
            return None
        self.kill()  # before its number may be somebody else's
        status = self.process.wait()
        self.process = None
        return status


class Supervisor:
    """Runs programs until a SIGINT or SIGTERM comes; then ends them all.

    One that ends by itself is started again after a pause that grows to :data:`LONGEST_PAUSE_S`, and so is a worker
    that says that it could not start its processes. Only a ``vital`` one that has ended :data:`TRIES_TO_LIVE` times in
    a row soon after its start ends all. Nothing outlives the supervisor, not even after SIGKILL: the kernel ends the
    children of a parent that died.
    """

    def __init__(self) -> None:
        self._programs: dict[str, _Program] = {}
        self._lines: queue.Queue[tuple[str, str, str]] = queue.Queue()  # who says it, in which colour, what
        self._colours = cycle(COLOURS)
        self._status: int | None = None  # not None: all are to end, and with what status
        self._culprit: str | None = None

    def add(
        self,
        name: str,
        command: Sequence[str],
        environment: dict[str, str],
        *,
        needed_to_the_end: bool = False,
        vital: bool = False,
    ) -> None:
        """Add a program. ``name`` stands before each line that it prints.

        One that is ``needed_to_the_end`` is ended when all others have ended; without a ``vital`` one nothing goes.
        """
        colour = next(self._colours)
        self._programs[name] = _Program(name, command, environment, colour, needed_to_the_end, vital)

    def say(self, text: str) -> None:
        """Print a line of our own; safe from any thread."""
        self._lines.put(("paddock", "", text))

    def run(self, beside: Callable[[], None]) -> tuple[str | None, int]:
        """Run to the end, with ``beside`` in a thread. Returns the vital program that could not live (None: we were
        told to stop) and the exit status, negative for its signal."""
        for signum in (signal.SIGTERM, signal.SIGINT):
            signal.signal(signum, self._stop)
        threading.Thread(target=beside, daemon=True).start()
        while True:
            for program in self._programs.values():
                self._watch(program)
            if self._status is not None and not self._end_what_is_due():
                break
            self._print_lines(TURN_S)
        self._print_lines(0)
        return self._culprit, self._status

    def _stop(self, signum: int, frame: object) -> None:
        if self._status is None:
            self._status = 128 + signum

    def _watch(self, program: _Program) -> None:
        status = program.ended()
        if status is not None and self._status is None:
            self._note_death(program, status)
        if self._status is not None:
            return
        if program.process is None and monotonic() >= program.due:
            self._start(program)
        elif program.is_sick:
            program.tell_to_end()

    def _note_death(self, program: _Program, status: int) -> None:
        lived = monotonic() - program.started > LIVES_AFTER_S
        program.deaths = 1 if lived else program.deaths + 1
        if program.vital and program.deaths >= TRIES_TO_LIVE:
            self._culprit, self._status = program.name, status
            return
        pause = min(2.0 ** min(program.deaths - 1, 10), LONGEST_PAUSE_S)
        program.due = monotonic() + pause
        how = f"signal {-status}" if status < 0 else f"exit status {status}"
        self.say(f"{program.name} ended by itself ({how}). It is started again in {pause:.0f} s.")

    def _start(self, program: _Program) -> None:
        program.started, program.told_at, program.is_sick = monotonic(), None, False
        program.process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _BOUND, str(os.getpid()), *program.command],
            env=program.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        threading.Thread(target=self._listen, args=(program, program.process), daemon=True).start()

    def _listen(self, program: _Program, process: subprocess.Popen) -> None:
        """Pass on what a program prints, until it has ended."""
        assert process.stdout is not None, "it was started with a pipe"
        with process.stdout as output:
            for line in output:
                self._lines.put((program.name, program.colour, line.decode("utf-8", "replace")))
                if SICK in line and program.process is process:
                    program.is_sick = True

    def _end_what_is_due(self) -> bool:
        """End every program that no running program needs. Whether any runs."""
        running = [program for program in self._programs.values() if program.process is not None]
        due = [program for program in running if not program.to_the_end] or running
        for program in due:
            program.tell_to_end()
        return bool(running)

    def _print_lines(self, wait_s: float) -> None:
        """Print what there is; wait for the first line for at most ``wait_s``."""
        with suppress(queue.Empty):
            self._print(*(self._lines.get(timeout=wait_s) if wait_s else self._lines.get_nowait()))
            while True:
                self._print(*self._lines.get_nowait())

    def _print(self, name: str, colour: str, text: str) -> None:
        width = max(map(len, (*self._programs, "paddock")))
        before = f"{datetime.now():%H:%M:%S} {name:{width}} | "
        if colour and sys.stdout.isatty():
            before = f"\033[{colour}m{before}\033[0m"
        for line in text.splitlines():
            print(before + line, flush=True)


def end_with_parent(parent: int, signum: int) -> None:
    """Ask the kernel to send this process ``signum`` when its parent (the thread that started it) ends (prctl(2))."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signum, 0, 0, 0)
        if os.getppid() != parent:  # it ended before we asked
            os.kill(os.getpid(), signum)
