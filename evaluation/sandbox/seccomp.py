"""The system calls that a locked process keeps, as a BPF program.

An allow-list: every other call answers EPERM. The launcher compiles the program with libseccomp; the sandboxed process
installs it with one call. ``open`` and ``clone`` are not on the list in any form.
"""

import ctypes
import errno
import functools
import os
from typing import Any

# What Python, numpy, OpenCV, Bullet and onnxruntime need to compute and to use pipes that are already open.
_COMPUTE = (
    *("read", "readv", "write", "writev", "close", "poll", "ppoll", "select", "pselect6", "lseek", "fstat"),
    *("munmap", "mremap", "madvise", "brk", "membarrier", "getrandom"),
    *("futex", "futex_waitv", "set_robust_list", "rseq", "restart_syscall"),
    *("sched_yield", "sched_getaffinity", "getcpu", "uname", "sysinfo", "getrusage", "times", "getrlimit"),
    *("rt_sigaction", "rt_sigprocmask", "rt_sigreturn", "rt_sigtimedwait", "sigaltstack"),
    *("clock_gettime", "clock_getres", "clock_nanosleep", "nanosleep", "gettimeofday", "time"),
    *("getpid", "getppid", "gettid", "getuid", "geteuid", "getgid", "getegid", "getresuid", "getresgid"),
)

# glibc tries these first and falls back when the kernel "does not have" them; EPERM would be taken as final.
_ABSENT = ("clone3",)

_PROT_EXEC = 4
# Above it a status would be taken for the signal that it imitates: bubblewrap returns 128 + the signal's number.
_GREATEST_STATUS = 127
_F_GETFD, _F_GETFL, _F_SETFL = 1, 3, 4

_SECCOMP_SET_MODE_FILTER = 1
_FILTER_FLAG_TSYNC = 1
_SYSCALL_SECCOMP = {"x86_64": 317, "aarch64": 277}


class _FilterProgram(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("filter", ctypes.c_void_p)]


@functools.cache
def build() -> bytes:
    """Compile the filter. Raises RuntimeError or OSError where libseccomp is missing."""
    import pyseccomp as scmp  # finding the library starts processes: never in the sandbox

    rules = scmp.SyscallFilter(scmp.ERRNO(errno.EPERM))
    for name in _COMPUTE:
        _allow(scmp, rules, name)
    for name in ("exit", "exit_group"):
        _allow(scmp, rules, name, scmp.Arg(0, scmp.LE, _GREATEST_STATUS))
        _add(scmp, rules, scmp.KILL_PROCESS, name, scmp.Arg(0, scmp.GT, _GREATEST_STATUS))
    not_executable = scmp.Arg(2, scmp.MASKED_EQ, _PROT_EXEC, 0)
    _allow(scmp, rules, "mmap", not_executable)
    _allow(scmp, rules, "mprotect", not_executable)
    for command in (_F_GETFD, _F_GETFL, _F_SETFL):
        _allow(scmp, rules, "fcntl", scmp.Arg(1, scmp.EQ, command))
    # getrlimit is prlimit64 without new values; the limits themselves stay as the lock set them.
    _allow(scmp, rules, "prlimit64", scmp.Arg(0, scmp.EQ, 0), scmp.Arg(2, scmp.EQ, 0))
    for name in _ABSENT:
        _add(scmp, rules, scmp.ERRNO(errno.ENOSYS), name)
    with open(os.memfd_create("seccomp"), "w+b") as file:
        rules.export_bpf(file)
        file.seek(0)
        return file.read()


def install(program: bytes) -> None:
    """Install the filter on every thread of this process, for ever. Needs no_new_privs. Raises OSError."""
    libc = ctypes.CDLL(None, use_errno=True)
    buffer = ctypes.create_string_buffer(program, len(program))
    prog = _FilterProgram(len(program) // 8, ctypes.addressof(buffer))
    number = _SYSCALL_SECCOMP.get(os.uname().machine)
    if number is None:
        raise OSError(f"no seccomp call number known for {os.uname().machine}")
    result = libc.syscall(
        ctypes.c_long(number), _SECCOMP_SET_MODE_FILTER, ctypes.c_ulong(_FILTER_FLAG_TSYNC), ctypes.byref(prog)
    )
    if result != 0:
        code = ctypes.get_errno()
        raise OSError(code, f"seccomp: {os.strerror(code)} ({result})")


def _allow(scmp: Any, rules: Any, name: str, *arguments: Any) -> None:
    _add(scmp, rules, scmp.ALLOW, name, *arguments)


def _add(scmp: Any, rules: Any, action: int, name: str, *arguments: Any) -> None:
    try:
        rules.add_rule(action, name, *arguments)
    except OSError as error:
        # This architecture or this libseccomp does not know the call: then it stays refused.
        if error.errno not in (errno.EINVAL, errno.EDOM, errno.ENOENT):
            raise
