"""Processes of bubblewrap that nobody is there for any more.

The first process inside waits for the outer one before it asks the kernel to die with it. If a worker is killed
by SIGKILL just then, the outer process dies with the worker, and the inner one waits for ever: before the sandbox
stands, so nothing of a stranger's runs in it, but it is there.
"""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

_SESSION = 3  # of the fields behind the name in /proc/PID/stat (proc(5)): state, parent, group, session


def end_orphans(command: str, proc: Path = Path("/proc")) -> list[int]:
    """Kill every process started with the argument ``command`` whose session leader, bubblewrap's outer process, is
    gone; their numbers. Those of other users, which may not be killed, stay."""
    ended = []
    for folder in proc.iterdir():
        if not folder.name.isdecimal():
            continue
        with contextlib.suppress(OSError):  # over by now, or not ours
            if command.encode() not in (folder / "cmdline").read_bytes().split(b"\0"):
                continue
            session = int((folder / "stat").read_bytes().rpartition(b")")[2].split()[_SESSION])
            if session and not (proc / str(session)).exists():
                os.kill(int(folder.name), signal.SIGKILL)
                ended.append(int(folder.name))
    return ended
