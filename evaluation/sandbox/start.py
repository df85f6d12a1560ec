"""Starts a process in the sandbox at a given level: in its own namespaces (:mod:`.bubblewrap`) at the strongest one,
and with its own lock (:mod:`.lock`) at every one."""

import compileall
import contextlib
import ctypes
import functools
import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

from paddock import exact

from . import bubblewrap, seccomp, uids
from .enter import COMMAND
from .limits import Limits
from .lock import VARIABLE, LockSpec
from .process import SandboxedProcess

LEVEL_NONE, LEVEL_PARTIAL, LEVEL_LOCK, LEVEL_NAMESPACES = 0, 1, 2, 3
CODE_ROOT = Path(__file__).resolve().parent.parent.parent
# racers who practise have the simulator without the rooms above it
_CODE = tuple(name for name in ("evaluation", "paddock", "training") if (CODE_ROOT / name).is_dir())
_PR_SET_CHILD_SUBREAPER = 36
_SESSION = 3  # of the fields behind the name in /proc/PID/stat (proc(5)): state, parent, group, session


def start(
    module: str,
    limits: Limits,
    level: int,
    arguments: Sequence[str] = (),
    pass_fds: Sequence[int] = (),
    python_path: Sequence[str | Path] = (),
    random: bool = False,
    memory: str = exact.LARGE_PAGES,
) -> SandboxedProcess:
    """:func:`.launch.launch` without asking the probe (which itself starts processes). Raises OSError and the like."""
    compile_code()
    end_orphans(COMMAND)  # what an earlier worker left; once per process
    home = _home()
    code = [str(CODE_ROOT / name) for name in _CODE] + [str(Path(part).resolve()) for part in python_path]
    as_root = os.geteuid() == 0
    uid = uids.claim() if as_root else None
    with contextlib.ExitStack() as ours_on_failure, contextlib.ExitStack() as theirs:
        if uid is not None:
            ours_on_failure.callback(uid.close)
        their_in, our_in = _pipe(theirs, ours_on_failure, reads="theirs")
        their_out, our_out = _pipe(theirs, ours_on_failure, reads="ours")
        their_err, our_err = _pipe(theirs, ours_on_failure, reads="ours")
        os.set_blocking(their_err, False)  # a flood of messages stops at the pipe's size instead of stopping anybody
        spec = LockSpec(limits, uid.uid if uid else None, seccomp.build())
        command = [home.executable, "-S", "-P", "-B", "-c", COMMAND]
        command += [str(their_in), str(their_out), module, *arguments]
        passed = [their_in, their_out, *pass_fds]
        our_info = None
        if level >= LEVEL_NAMESPACES:
            their_info, our_info = _pipe(theirs, ours_on_failure, reads="ours")
            bwrap = bubblewrap.find()
            if bwrap is None:
                raise OSError("bubblewrap is not installed")
            _adopt_orphans()
            command = bubblewrap.command(bwrap, home, code, their_info, as_root, random) + command
            passed.append(their_info)
        popen = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=their_err,
            env=_environment(home, spec, python_path, memory),
            cwd="/",
            pass_fds=passed,
            start_new_session=True,
        )
        ours_on_failure.pop_all()
        return SandboxedProcess(
            popen, limits=limits, stdin=our_in, stdout=our_out, stderr=our_err, info=our_info, uid=uid
        )


@functools.cache
def compile_code() -> None:
    """Byte-compile our own code once: inside, nothing can be written, and every start would compile it again."""
    for name in _CODE:
        with contextlib.suppress(OSError):
            compileall.compile_dir(CODE_ROOT / name, quiet=2)


@functools.cache
def end_orphans(command: str, proc: Path = Path("/proc")) -> list[int]:
    """Kill every process started with the argument ``command`` whose session leader, bubblewrap's outer process, is
    gone; their numbers.

    The inner process waits for the outer one before it asks the kernel to die with it: a SIGKILL of the worker in that
    moment leaves it waiting for ever, with nothing of a stranger's in it.
    """
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


@functools.cache
def _home() -> bubblewrap.PythonHome:
    return bubblewrap.python_home()


def _environment(
    home: bubblewrap.PythonHome, spec: LockSpec, python_path: Sequence[str | Path], memory: str
) -> dict[str, str]:
    """The whole environment: nothing of ours (keys, addresses) goes in."""
    path = [str(CODE_ROOT), *(str(Path(part).resolve()) for part in python_path), *home.packages]
    ours = {
        "PYTHONPATH": os.pathsep.join(path),
        "PYTHONHASHSEED": "0",
        "PYTHONUTF8": "1",
        "LD_LIBRARY_PATH": home.library_directory,
        "LC_ALL": "C.UTF-8",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "1",
        "GLIBC_TUNABLES": memory,
        "ORT_DISABLE_TELEMETRY": "1",  # onnxruntime's Linux wheel otherwise starts a thread that reports home
        VARIABLE: spec.to_env(),
    }
    return exact.environment(ours)


def _pipe(theirs: contextlib.ExitStack, ours: contextlib.ExitStack, reads: str) -> tuple[int, int]:
    """A pipe as (their end, our end); ours is non-blocking. ``reads``: the reading end, "ours" or "theirs"."""
    read, write = os.pipe()
    their_end, our_end = (read, write) if reads == "theirs" else (write, read)
    theirs.callback(os.close, their_end)
    ours.callback(os.close, our_end)
    os.set_blocking(our_end, False)
    return their_end, our_end


def _adopt_orphans() -> None:
    """Become the parent of processes that bubblewrap leaves behind: the first process of a container often does not
    reap them."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, ctypes.c_ulong(1), 0, 0, 0)
