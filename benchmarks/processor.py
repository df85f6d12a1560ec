"""Processor time of processes that are somebody else's children, read from /proc while they live."""

from __future__ import annotations

import contextlib
import os
import time

_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


class Clock:
    """Processor seconds of this process's descendants, as last seen: call :meth:`look` now and then, and :meth:`close`.

    The sandboxed processes die with their namespace and nobody waits for them, so that the kernel adds their time to no
    parent. A look costs some tens of microseconds, the first one a walk through /proc.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self._files: list[int] = []
        self._own = time.process_time()

    def look(self, _: object = None) -> None:
        """Read the clocks of the descendants that there were at the first look, and this process's own."""
        if not self._files:
            for pid in _descendants(os.getpid()):
                with contextlib.suppress(OSError):
                    self._files.append(os.open(f"/proc/{pid}/stat", os.O_RDONLY))
        sandboxed = sum(map(_ticks, self._files)) * _TICK_S
        self.seconds = max(self.seconds, sandboxed + time.process_time() - self._own)

    def close(self) -> None:
        """Give the files back."""
        for file in self._files:
            os.close(file)
        self._files = []


def _ticks(file: int) -> int:
    try:
        fields = os.pread(file, 1024, 0).rpartition(b")")[2].split()
    except OSError:
        return 0
    return int(fields[11]) + int(fields[12])  # proc(5): utime and stime, counted after the name


def _descendants(of: int) -> list[int]:
    parents = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                with open(f"/proc/{name}/stat") as stat:
                    parents[int(name)] = int(stat.read().rpartition(")")[2].split()[1])
            except OSError:
                continue
    found = {of}
    while more := {pid for pid, parent in parents.items() if parent in found and pid not in found}:
        found |= more
    return sorted(found - {of})
