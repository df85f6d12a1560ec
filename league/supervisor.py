"""Several programs in the foreground as one: a common log, and all of them end together. Built on honcho."""

from __future__ import annotations

import ctypes
import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial

from honcho import manager as honcho
from honcho.printer import Message
from honcho.process import Popen, Process

GRACE_S = 10
_PR_SET_PDEATHSIG = 1


class Supervisor(honcho.Manager):
    """Runs programs until one of them ends or a SIGINT or SIGTERM comes; then ends the others.

    Nothing outlives it, not even after SIGKILL: the kernel ends the children of a parent that died.
    """

    def __init__(self) -> None:
        super().__init__()
        self._process_ctor = _Bound
        self._ended_first: str | None = None
        self._needed_to_the_end: set[str] = set()
        self._ending = False
        self._told: set[str] = set()

    def add(
        self, name: str, command: Sequence[str], environment: dict[str, str], needed_to_the_end: bool = False
    ) -> None:
        """Add a program. ``name`` stands before each line that it prints.

        One that is ``needed_to_the_end`` is ended when all others have ended.
        """
        self.add_process(name, f"exec {shlex.join(command)}", env=environment)
        if needed_to_the_end:
            self._needed_to_the_end.add(name)

    def say(self, text: str) -> None:
        """Print a line of our own; safe from any thread."""
        self.events.put(Message(type="line", data=text, time=datetime.now(), name="paddock", colour=None))

    def run(self, beside: Callable[[], None]) -> tuple[str | None, int]:
        """Run to the end, with ``beside`` in a thread. Returns the program that ended by itself (None: we were told to
        stop) and the exit status."""
        honcho.KILL_WAIT = GRACE_S
        self._beside = beside
        self.loop()
        return self._ended_first, self.returncode or 0

    def terminate(self) -> None:
        """End all programs; honcho calls this on a signal, and when a program has ended."""
        if not self._ending:
            self._ending = True
            self._ended_first = next((name for name, p in self._processes.items() if "returncode" in p), None)
        self._end_what_is_due()

    def _start(self) -> None:
        super()._start()
        threading.Thread(target=self._beside, daemon=True).start()  # only now: a process with threads must not fork

    def _all_started(self) -> bool:
        """Honcho asks this in every turn of its loop: the place to end what could not be ended before."""
        if self._ending:
            self._end_what_is_due()
        return super()._all_started()

    def _end_what_is_due(self) -> None:
        """Send SIGTERM, once, to every program that is known to run and that no running program needs."""
        running = {name for name, p in self._processes.items() if "returncode" not in p}
        due = running - self._needed_to_the_end or running
        for name in due - self._told:
            pid = self._processes[name].get("pid")
            if pid is not None:  # else it is only just being started
                self._told.add(name)
                self._procmgr.terminate(pid)

    def _system_print(self, data: str) -> None:
        """Honcho's own lines (started, sending SIGTERM) say nothing that anybody needs."""


class _Bound(Process):
    """A program that ends with the process that started it: honcho's helper, which ends with the supervisor."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self._supervisor = os.getpid()

    def run(self, events=None, ignore_signals: bool = False) -> None:
        """What honcho's helper process does."""
        end_with_parent(self._supervisor, signal.SIGKILL)
        self._child_ctor = partial(Popen, preexec_fn=partial(end_with_parent, os.getpid(), signal.SIGTERM))
        super().run(events, ignore_signals)


def end_with_parent(parent: int, signum: int) -> None:
    """Ask the kernel to send this process ``signum`` when its parent (the thread that started it) ends (prctl(2))."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signum, 0, 0, 0)
        if os.getppid() != parent:  # it ended before we asked
            os.kill(os.getpid(), signum)
