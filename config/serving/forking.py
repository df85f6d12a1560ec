"""Processes that begin as a fork of this one, and so share what it has loaded (a second and 100 MB).

A fork goes on with the one thread that started it, so the process that forks must have no other.
"""

import ctypes
import io
import os
import runpy
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

PYTHON = [sys.executable, "-m"]  # how the command of a module begins
STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
_PR_SET_PDEATHSIG = 1
_ARGUMENTS, _ENVIRONMENT_END = 47, 50  # of the numbers in /proc/self/stat, from 0: proc(5), arg_start and env_end


def fork(work: Callable[[], object], inherited: Sequence[int] = ()) -> tuple[int, int]:
    """Do ``work`` in a separate process and session, which ends with this one and has none of our open files but those
    that are ``inherited``. Returns its id and where its output can be read."""
    reading, writing = os.pipe()
    ours = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)  # until the fork has set its handlers
    pid = os.fork()
    if pid == 0:
        _begin(work, writing, ours, inherited)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    os.close(writing)
    return pid, reading


def become(command: Sequence[str], nice: int = 0) -> None:
    """Run the program of ``command``: a module (``PYTHON``, its name, arguments) in this process, any other in its
    place."""
    os.nice(nice)
    if list(command[:2]) != PYTHON:
        os.execvp(command[0], list(command))
    show(command)
    sys.argv = list(command[2:])
    runpy.run_module(command[2], run_name="__main__", alter_sys=True)


def end_with_parent(parent: int, signum: int) -> None:
    """Ask the kernel to send this process ``signum`` when its parent (the thread that started it) ends (prctl(2))."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signum, 0, 0, 0)
        if os.getppid() != parent:  # it ended before we asked
            os.kill(os.getpid(), signum)


def _begin(work: Callable[[], object], output: int, parent: int, inherited: Sequence[int]) -> NoReturn:
    status = 1
    try:
        os.setsid()
        os.dup2(output, 1)
        os.dup2(output, 2)
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        kept = sorted(inherited)
        for after, before in zip([2, *kept], [*kept, os.sysconf("SC_OPEN_MAX")], strict=True):
            os.closerange(after + 1, before)
        for signum in STOP_SIGNALS:
            signal.signal(signum, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
        end_with_parent(parent, signal.SIGTERM)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)
        work()
        status = 0
    except SystemExit as end:
        status = _status(end)
    except (Exception, KeyboardInterrupt):  # it ends this process with its traceback, as it would any that Python runs
        traceback.print_exc()
    finally:
        _end(status)


def _status(end: SystemExit) -> int:
    if end.code is None or isinstance(end.code, int):
        return end.code or 0
    print(end.code, file=sys.stderr)
    return 1


def _end(status: int) -> NoReturn:
    """End as Python does, but for our parent's exit handlers. Threads first: idle threads of an executor end only on
    this call."""
    threading._shutdown()  # type: ignore[attr-defined]
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def show(command: Sequence[str]) -> None:
    """Have ``ps`` and ``top`` show ``command``: they read it where the kernel has put the arguments and, behind them,
    the environment, which moves away first."""
    if sys.platform != "linux":
        return
    for name, value in os.environb.items():
        os.putenv(name, value)
    numbers = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    begin, end = int(numbers[_ARGUMENTS - 2]), int(numbers[_ENVIRONMENT_END - 2])
    shown = os.fsencode(" ".join(command))[: end - begin - 1]
    ctypes.memset(begin, 0, end - begin)
    ctypes.memmove(begin, shown, len(shown))
