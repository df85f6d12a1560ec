"""The environment of a process that drives at home, and how a command starts anew in it."""

import os
import sys
from pathlib import Path

from paddock import exact

_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ORT_DISABLE_TELEMETRY": "1", "PYTHONUTF8": "1"}
# Without Python's module ``site``, which takes longer to start than the rest of an interpreter; and not with what lies
# in the current folder, which is a racer's.
PYTHON = (sys.executable, "-S", "-P")


def environment() -> dict[str, str]:
    """The environment for :data:`PYTHON`, which then finds packages where this process does."""
    packages = os.pathsep.join([*filter(None, sys.path), str(Path(__file__).parents[2])])
    tunables = ":".join(filter(None, (os.environ.get("GLIBC_TUNABLES"), exact.LARGE_AND_KEPT)))
    return exact.environment({**os.environ, **_ONE_THREAD, "PYTHONPATH": packages, "GLIBC_TUNABLES": tunables})


def is_ready() -> bool:
    """Whether this process was started so. A copy of it can drive, and need not import everything again."""
    if sys.platform != "linux" or None in (sys.stdin, sys.stdout, sys.stderr):  # closed: other files get its number
        return False
    return bool(sys.flags.no_site) and exact.is_pinned() and _ONE_THREAD.items() <= dict(os.environ).items()


def get_ready() -> None:
    """Start an evaluation anew so, before more is imported. Returns for all else: a command that asks a site needs what
    ``site`` loads, such as the certificates of a proxy."""
    command, *options = sys.argv[1:] or [""]
    asks_site = any(option.partition("=")[0] == "--race" for option in options)
    if sys.platform == "linux" and command == "evaluate" and not asks_site and not sys.flags.no_site and sys.executable:
        os.execve(sys.executable, [*PYTHON, "-m", "paddock.cli", *sys.argv[1:]], environment())
