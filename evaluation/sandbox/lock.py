"""The lock that a sandboxed process closes after its imports and before it reads anything untrusted.

In this order: no_new_privs, the private user id (and with it every capability), death with the parent, Landlock,
resource limits, seccomp. Then forbidden calls are tried: a lock that did not close ends the process.
"""

from __future__ import annotations

import base64
import ctypes
import errno
import json
import os
import resource
import socket
import struct
from dataclasses import asdict, dataclass

from . import landlock, seccomp
from .limits import Limits

VARIABLE = "PADDOCK_SANDBOX"
EXIT_NOT_LOCKED, EXIT_IMPORT, EXIT_MEMORY, EXIT_ERROR = 70, 71, 72, 73
_PR_SET_PDEATHSIG, _PR_SET_DUMPABLE, _PR_SET_NO_NEW_PRIVS = 1, 4, 38
_SIGKILL = 9
_CLONE_VM = 0x100


@dataclass(frozen=True)
class LockSpec:
    """The launcher's decision: limits, the private user id (None: keep it) and the seccomp program."""

    limits: Limits
    uid: int | None
    program: bytes

    def to_env(self) -> str:
        program = base64.b64encode(self.program).decode()
        return json.dumps({"limits": asdict(self.limits), "uid": self.uid, "program": program}, separators=(",", ":"))

    @classmethod
    def from_env(cls, text: str) -> LockSpec:
        data = json.loads(text)
        return cls(Limits(**data["limits"]), data["uid"], base64.b64decode(data["program"]))


class LockFailed(Exception):
    """A layer could not be closed: the process must end."""


def lock_down() -> None:
    """Lock this process for ever, as its launcher decided; once in its life. Raises LockFailed when the process was not
    started by :func:`evaluation.sandbox.launch.launch`, or when a layer does not close."""
    text = os.environ.get(VARIABLE)
    if text is None:
        raise LockFailed("this process was not started by evaluation.sandbox.launch")
    spec = LockSpec.from_env(text)
    try:
        _close_layers(spec)
    except (OSError, ValueError) as error:
        raise LockFailed(str(error)) from error
    _try_the_doors(spec)


def _close_layers(spec: LockSpec) -> None:
    libc = ctypes.CDLL(None, use_errno=True)

    def prctl(option: int, value: int) -> None:
        if libc.prctl(option, ctypes.c_ulong(value), 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), f"prctl {option}")

    _require_one_thread(libc)
    prctl(_PR_SET_NO_NEW_PRIVS, 1)
    if spec.uid is not None:
        os.setgroups([])
        os.setresgid(spec.uid, spec.uid, spec.uid)
        os.setresuid(spec.uid, spec.uid, spec.uid)
    prctl(_PR_SET_PDEATHSIG, _SIGKILL)  # a change of user id forgets it
    prctl(_PR_SET_DUMPABLE, 0)
    _drop_capabilities(libc)
    landlock.restrict_self()
    _limit_resources(spec.limits)
    seccomp.install(spec.program)


def _require_one_thread(libc: ctypes.CDLL) -> None:
    """Landlock would not reach another thread. Raises OSError with the true reason."""
    if libc.unshare(_CLONE_VM) == 0:  # does nothing but fail in a process with more threads than this one
        return
    code = ctypes.get_errno()
    if code == errno.EINVAL:
        raise OSError("a thread is already running")
    try:  # a container's seccomp profile refuses the call itself; there the list of processes can be read
        threads = len(os.listdir("/proc/self/task"))
    except OSError:
        raise OSError(code, f"unshare: {os.strerror(code)}, and without /proc no thread can be counted") from None
    if threads != 1:
        raise OSError("a thread is already running")


def _drop_capabilities(libc: ctypes.CDLL) -> None:
    """Empty every capability set (linux/capability.h, version 3), and look that they are."""
    header = struct.pack("<Ii", 0x20080522, 0)
    if libc.capset(header, bytes(24)) != 0:
        raise OSError(ctypes.get_errno(), "capset")
    left = ctypes.create_string_buffer(24)
    if libc.capget(header, left) != 0 or any(left.raw):
        raise OSError("capabilities are left")


def _limit_resources(limits: Limits) -> None:
    megabyte = 1024 * 1024
    for kind, value in (
        (resource.RLIMIT_AS, limits.address_space_mb * megabyte),
        (resource.RLIMIT_NOFILE, limits.open_files),
        (resource.RLIMIT_NPROC, 1),  # this process alone; for a root launcher the user id is private
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_MEMLOCK, 0),
        (resource.RLIMIT_MSGQUEUE, 0),
    ):
        _soft, hard = resource.getrlimit(kind)
        if hard != resource.RLIM_INFINITY:
            value = min(value, hard)
        resource.setrlimit(kind, (value, value))
    resource.setrlimit(resource.RLIMIT_CPU, (limits.cpu_s, limits.cpu_s + 1))  # SIGXCPU, and SIGKILL if that is ignored


def _try_the_doors(spec: LockSpec) -> None:
    """Fail closed: try once what must not work. (Failed attempts cost microseconds.)"""
    if 0 in (os.getuid(), os.geteuid(), os.getgid(), os.getegid()) and spec.uid is not None:
        raise LockFailed("still root")
    for name, attempt in (
        ("files", lambda: os.open("/etc/passwd", os.O_RDONLY)),
        ("writing", lambda: os.open("/paddock-probe", os.O_WRONLY | os.O_CREAT)),
        ("sockets", lambda: socket.socket(socket.AF_INET)),
        ("signals", lambda: os.kill(os.getpid(), 0)),
        ("processes", _fork),
    ):
        try:
            attempt()
        except OSError:
            continue
        raise LockFailed(f"the lock left a door open: {name}")


def _fork() -> None:
    if os.fork() == 0:
        os._exit(EXIT_NOT_LOCKED)
