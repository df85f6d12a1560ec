"""Builds the bubblewrap command line: empty namespaces and the few read-only files that a Python process needs."""

import os
import shutil
import sys
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

# onnxruntime chooses its kernels by what it reads here: without them it might compute other last bits than elsewhere.
_PROCESSOR = ("/proc/cpuinfo", "/sys/devices/system/cpu")
# What the C library reads before it asks for large pages, see :mod:`.start`.
_LARGE_PAGES = tuple(f"/sys/kernel/mm/transparent_hugepage/{name}" for name in ("enabled", "hpage_pmd_size"))
_RANDOM = "/dev/urandom"
_SYSTEM_LIBRARIES = ("/usr/lib", "/usr/lib32", "/usr/lib64", "/lib", "/lib32", "/lib64")


@dataclass(frozen=True)
class PythonHome:
    """Where this interpreter and the packages live. All absolute paths."""

    executable: str
    library_directory: str  # of libpython
    parts: tuple[str, ...]  # files and directories the interpreter needs
    packages: tuple[str, ...]  # directories for sys.path: site-packages


def python_home() -> PythonHome:
    """Find the real interpreter behind a virtual environment, and the directories of the installed packages."""
    executable = os.path.realpath(sys.executable)
    shared = _libpython()
    wanted = {
        executable,
        shared or executable,
        os.path.realpath(sysconfig.get_paths()["stdlib"]),
        os.path.realpath(sysconfig.get_paths()["platstdlib"]),
        os.path.join(sys.base_prefix, sys.platlibdir, f"python3.{sys.version_info.minor}"),
        os.path.join(sys.base_prefix, "lib", f"python3.{sys.version_info.minor}"),
    }
    parts = tuple(sorted(path for path in wanted if os.path.exists(path)))
    packages = tuple(
        dict.fromkeys(path for path in sys.path if path.rstrip("/").endswith(("site-packages", "dist-packages")))
    )
    packages = tuple(path for path in packages if os.path.isdir(path))
    return PythonHome(executable, os.path.dirname(shared or executable), parts, packages)


def _libpython() -> str | None:
    """The shared library of this interpreter (build records may be stale); None where it is linked in."""
    with open("/proc/self/maps", encoding="utf-8", errors="surrogateescape") as lines:
        for line in lines:
            path = line.rstrip("\n").partition("/")[2]
            if os.path.basename(path).startswith("libpython3"):
                return "/" + path
    return None


def find() -> str | None:
    return shutil.which("bwrap", path=os.environ.get("PATH", "") + os.pathsep + "/usr/local/bin:/usr/bin:/bin")


def is_filtered() -> bool:
    """Whether this process itself runs under a seccomp filter, as in a plain container."""
    try:
        with open("/proc/self/status", encoding="ascii", errors="replace") as lines:
            return any(line.split() == ["Seccomp:", "2"] for line in lines)
    except OSError:
        return False


def _sysctls_are_read_only() -> bool:
    return bool(os.statvfs("/proc/sys").f_flag & os.ST_RDONLY)


def command(bwrap: str, home: PythonHome, code: Iterable[str], info_fd: int, as_root: bool, random: bool) -> list[str]:
    """Arguments up to and including ``--``. ``code``: more files and directories to show at their own paths.
    ``random``: show ``/dev/urandom`` too.

    Root starts without a user namespace and keeps CAP_SETUID and CAP_SETGID until the lock takes the private user id
    (RLIMIT_NPROC does not count for a root that a user namespace renames); others need the namespace.

    bubblewrap's first process stays in the pid namespace: when the launcher dies, the outer bubblewrap has no CAP_KILL
    for the private user id, but may signal that process, and the kernel then ends the namespace.
    """
    arguments = [bwrap, "--unshare-ipc", "--unshare-pid", "--unshare-net", "--unshare-uts", "--unshare-cgroup-try"]
    arguments += ["--die-with-parent", "--new-session"]
    if not is_filtered():  # the profile of a container refuses it, and the name is the container's already
        arguments += ["--hostname", "paddock"]
    if as_root:
        arguments += ["--cap-drop", "ALL", "--cap-add", "CAP_SETUID", "--cap-add", "CAP_SETGID"]
    else:
        arguments += ["--unshare-user", "--uid", "65534", "--gid", "65534"]
        if not _sysctls_are_read_only():  # as in a container; the lock's system calls make no namespaces either way
            arguments.append("--disable-userns")
    arguments += _mounts([*home.parts, *home.packages, *filter(os.path.exists, (*_PROCESSOR, *_LARGE_PAGES)), *code])
    if random:
        arguments += ["--perms", "0755", "--dir", "/dev", "--dev-bind", _RANDOM, _RANDOM]
    arguments += ["--chdir", "/", "--remount-ro", "/", "--info-fd", str(info_fd), "--"]
    return arguments


def _mounts(paths: Iterable[str]) -> list[str]:
    arguments: list[str] = []
    bound: list[str] = []
    for path in _SYSTEM_LIBRARIES:
        if os.path.islink(path):
            arguments += ["--symlink", os.readlink(path), path]
        elif os.path.isdir(path):
            arguments += ["--ro-bind", path, path]
            bound.append(path)
    made: set[str] = set(bound)
    for path in sorted(set(paths), key=lambda path: (len(Path(path).parts), path)):
        if any(Path(path).is_relative_to(parent) for parent in bound):
            continue
        for parent in reversed(Path(path).parents):
            # bubblewrap would make them as private as their originals: the unprivileged id could not pass.
            if str(parent) != "/" and str(parent) not in made:
                arguments += ["--perms", "0755", "--dir", str(parent)]
                made.add(str(parent))
        arguments += ["--ro-bind", path, path]
        bound.append(path)
    return arguments
