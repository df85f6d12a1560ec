"""A running sandboxed process: its pipes, its exit status and what it has used."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import signal
import subprocess
import time
from dataclasses import replace

from . import uids
from .frames import LOCKED, FrameError, FrameMalformed, read_message, wait_for
from .limits import STDERR_LIMIT, Limits

_PIPE_SIZE = 1024 * 1024
_SHORT_MESSAGE = 4096  # bytes
_GRACE_S = 5.0
# A locked process can send no signal, not even to itself, and no fault inside it ends in one of these: somebody
# outside of the sandbox did it, or a host that is short of memory. (SIGKILL also follows on RLIMIT_CPU, a second after
# SIGXCPU: a caller with a low limit checks the seconds, too.)
FROM_OUTSIDE = frozenset(
    -number for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
)


class SandboxedProcess:
    """A running sandboxed process. Use it as a context manager: leaving kills it and closes every descriptor.

    Enter, use and leave it in one thread: the kernel ties the process to the thread that started it.
    ``stdin``/``stdout``: our non-blocking ends of its pipes. ``deadline``: the ``time.monotonic()`` instant at which
    ``wall_s`` is over.
    """

    def __init__(
        self,
        popen: subprocess.Popen,
        *,
        limits: Limits,
        stdin: int,
        stdout: int,
        stderr: int,
        info: int | None,
        uid: uids.PrivateUid | None,
    ) -> None:
        self.limits = limits
        self.pid: int = popen.pid
        self._stdin: int | None = stdin
        self._stdout: int | None = stdout
        self.deadline = time.monotonic() + limits.wall_s
        self.cpu_s = 0.0  # at its end; the limit if it ran into that; 0.0 if bubblewrap keeps it to itself
        self._popen = popen
        self._stderr: int | None = stderr
        self._stderr_text = b""
        self._info = info
        self._is_watched = info is not None
        self._uid = uid
        self._inner: int | None = None if info is not None else popen.pid
        self._first: int | None = None
        self._first_fd: int | None = None
        self._peak_kb = 0
        self._status: int | None = None

    def __enter__(self) -> SandboxedProcess:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    @property
    def stdin(self) -> int:
        """Our end of its input. Raises ValueError once that is closed."""
        return _still_open(self._stdin)

    @property
    def stdout(self) -> int:
        """Our end of its output. Raises ValueError once that is closed."""
        return _still_open(self._stdout)

    def widen_pipes(self) -> None:
        """:func:`widen_pipe` for both ways."""
        widen_pipe(self.stdin)
        widen_pipe(self.stdout)

    def wait_for_lock(self, start_s: float) -> None:
        """Wait for its message that it is locked. Before, it has seen nothing of a stranger's. Raises FrameError."""
        header, _ = read_message(self.stdout, time.monotonic() + start_s, json_limit=_SHORT_MESSAGE, blob_limit=0)
        if header != LOCKED:
            raise FrameMalformed("it did not say that it is locked")

    def allow(self, wall_s: float) -> None:
        """Start its wall time now, with this limit."""
        self.limits = replace(self.limits, wall_s=wall_s)
        self.deadline = time.monotonic() + wall_s

    @property
    def inner_pid(self) -> int | None:
        """The sandboxed process itself (``pid`` may be bubblewrap's), as this process numbers it. None while there is
        none."""
        if self._inner is None and self._first_process() is not None and self._first is not None:
            self._inner = _child_of(self._first)
        return self._inner

    def _first_process(self) -> int | None:
        """The descriptor of the first process in the pid namespace; None without namespaces, or when there is none."""
        if self._info is not None:
            self._first = _read_child_pid(self._info)
            os.close(self._info)
            self._info = None
            if self._first is not None:
                with contextlib.suppress(ProcessLookupError):
                    self._first_fd = os.pidfd_open(self._first)
        return self._first_fd

    def poll(self) -> int | None:
        """The exit status if it is over: >= 0 its own, < 0 the signal that killed it (never its own doing for those in
        :data:`FROM_OUTSIDE`)."""
        return self.wait(0)

    def wait(self, timeout: float | None = None) -> int | None:
        """Wait for the end, at most ``timeout`` seconds; the exit status as in :meth:`poll`, None if it still runs."""
        if self._status is not None:
            return self._status
        with contextlib.suppress(ChildProcessError):  # somebody else's waitpid(-1) took it: status unknown
            if timeout != 0:
                pidfd = os.pidfd_open(self.pid)
                try:
                    _wait_readable(pidfd, timeout)
                finally:
                    os.close(pidfd)
            pid, status, usage = os.wait4(self.pid, os.WNOHANG)
            if pid == 0:
                return None
            self.cpu_s = usage.ru_utime + usage.ru_stime
            self._bury_first_process()
            self._end(os.waitstatus_to_exitcode(status))
            return self._status
        self._end(0)
        return self._status

    def kill(self) -> None:
        """Kill the process and everything in its namespace, and wait until the kernel has cleared it away."""
        if self.poll() is not None:
            return
        first = self._first_process()
        if first is not None:
            # The first process of a pid namespace takes all others with it before bubblewrap hears of its death.
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(first, signal.SIGKILL)
        else:
            os.kill(self.pid, signal.SIGKILL)
        if self.wait(_GRACE_S) is None:
            os.kill(self.pid, signal.SIGKILL)
            self.wait()

    def close(self) -> None:
        """Kill what still runs and give everything back. Does nothing the second time."""
        self.peak_mb()
        self.kill()
        self.stderr_text()
        self.close_pipes()
        for fd in (self._stderr, self._info, self._first_fd):
            if fd is not None:
                os.close(fd)
        self._stderr = self._info = self._first_fd = None
        if self._uid is not None:
            self._uid.close()

    def close_pipes(self) -> None:
        for fd in (self._stdin, self._stdout):
            if fd is not None:
                os.close(fd)
        self._stdin = self._stdout = None

    def stderr_text(self) -> str:
        """Its stderr so far, at most the first 64 kB, for operators: a stranger may have written it."""
        while self._stderr is not None and len(self._stderr_text) < STDERR_LIMIT:
            try:
                chunk = os.read(self._stderr, STDERR_LIMIT - len(self._stderr_text))
            except BlockingIOError:
                break
            if not chunk:
                break
            self._stderr_text += chunk
        text = self._stderr_text.decode("utf-8", "replace")
        return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in text)

    def peak_mb(self) -> float:
        """The largest resident set of the sandboxed process seen so far (VmHWM), in MB of 2**20 bytes."""
        if self._status is None and self.inner_pid is not None:
            with contextlib.suppress(OSError), open(f"/proc/{self.inner_pid}/status", encoding="ascii") as lines:
                for line in lines:
                    if line.startswith("VmHWM:"):
                        self._peak_kb = max(self._peak_kb, int(line.split()[1]))
        return self._peak_kb / 1024

    def cpu_seconds(self) -> float:
        """CPU time of the sandboxed process so far, to a hundredth of a second, or to a microsecond while it waits; 0.0
        once it is over."""
        path = f"/proc/{self.inner_pid}/schedstat"  # of its first thread, which is all that its limits let it have
        with contextlib.suppress(OSError, ValueError, IndexError), open(path, "rb") as file:
            if nanoseconds := int(file.read().split()[0]):  # not every kernel tells
                return nanoseconds / 1e9
        fields = self._stat()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK") if fields else 0.0  # utime, stime

    def wants_processor(self) -> bool:
        """Whether it computes, or would if the host let it (also while it waits for memory to be paged in)."""
        fields = self._stat()
        return bool(fields) and fields[0] in (b"R", b"D")

    def _stat(self) -> list[bytes]:
        """The fields of proc(5)'s stat from the third on, empty once it is over."""
        with contextlib.suppress(OSError), open(f"/proc/{self.inner_pid}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()
        return []

    def _bury_first_process(self) -> None:
        """bubblewrap does not wait for its first process when that ends by itself: then it was left to us."""
        first = self._first_process()
        if first is not None:
            _wait_readable(first, _GRACE_S)
            with contextlib.suppress(ChildProcessError):
                os.waitid(os.P_PIDFD, first, os.WEXITED | os.WNOHANG)

    def _end(self, code: int) -> None:
        # bubblewrap reports a signal as 128 + number, as shells do; no locked process can end with such a status itself
        self._status = 128 - code if self._is_watched and code > 128 else code
        if self._status == -signal.SIGXCPU:
            self.cpu_s = max(self.cpu_s, self.limits.cpu_s)
        self._popen.returncode = self._status


def widen_pipe(fd: int) -> None:
    """Let the pipe hold 1 MB (a 20 MB network then needs a hundredth of the wake-ups), if the host permits."""
    with contextlib.suppress(OSError):
        fcntl.fcntl(fd, fcntl.F_SETPIPE_SZ, _PIPE_SIZE)


def _still_open(fd: int | None) -> int:
    if fd is None:
        raise ValueError("its pipes are closed")
    return fd


def _read_child_pid(info: int) -> int | None:
    """bubblewrap's ``{"child-pid": N, ...}``; None when it died before it had a child."""
    data = b""
    with contextlib.suppress(FrameError):
        while b"}" not in data:
            wait_for(info, select.POLLIN, time.monotonic() + _GRACE_S)
            chunk = os.read(info, 4096)
            if not chunk:
                return None
            data += chunk
        return json.loads(data)["child-pid"]
    return None


def _child_of(pid: int) -> int | None:
    """The one child of bubblewrap's first process; None before it is born or after it died."""
    with contextlib.suppress(OSError), open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as file:
        return next(map(int, file.read().split()), None)
    return None


def _wait_readable(pidfd: int, timeout: float | None) -> None:
    poller = select.poll()
    poller.register(pidfd, select.POLLIN)
    poller.poll(None if timeout is None else timeout * 1000)
