"""Several programs in the foreground as one: a common log, and all of them end together. Built on honcho."""

from __future__ import annotations

import ctypes
import os
import shlex
import signal
import sys
from collections.abc import Sequence
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
        self._stop_wanted = False

    def add(self, name: str, command: Sequence[str], environment: dict[str, str]) -> None:
        """Add a program. ``name`` stands before each line that it prints."""
        self.add_process(name, f"exec {shlex.join(command)}", env=environment)

    def say(self, text: str) -> None:
        """Print a line of our own; safe from any thread."""
        self.events.put(Message(type="line", data=text, time=datetime.now(), name="paddock", colour=None))

    def run(self) -> tuple[str | None, int]:
        """Run to the end. Returns the program that ended by itself (None: we were told to stop) and the exit status."""
        honcho.KILL_WAIT = GRACE_S
        self._ended_first: str | None = None
        self.loop()
        if self._ended_first is None or self.returncode in (128 + signal.SIGINT, 128 + signal.SIGTERM):
            return None, self.returncode or 0
        return self._ended_first, self.returncode or 0

    def terminate(self) -> None:
        """End all programs; those that are only just being started as soon as they are known."""
        if self._ended_first is None:
            self._ended_first = next((name for name, p in self._processes.items() if "returncode" in p), None)
        if self._all_started():
            super().terminate()
        else:
            self._stop_wanted = True

    def _all_started(self) -> bool:
        started = super()._all_started()
        if started and self._stop_wanted:
            self._stop_wanted = False
            super().terminate()
        return started

    def _system_print(self, data: str) -> None:
        """Honcho's own lines (started, sending SIGTERM) say nothing that anybody needs."""


class _Bound(Process):
    """A program that ends with the process that started it."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self._child_ctor = partial(Popen, preexec_fn=partial(end_with_parent, signal.SIGTERM))

    def run(self, events=None, ignore_signals: bool = False) -> None:
        end_with_parent(signal.SIGKILL)
        super().run(events, ignore_signals)


def end_with_parent(signum: int) -> None:
    """Ask the kernel to send this process ``signum`` when the thread that started it ends (prctl(2))."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signum, 0, 0, 0)
        if os.getppid() == 1:  # it died before we asked
            os.kill(os.getpid(), signum)
