"""Starts one of our modules in a separate process, inside the sandbox.

::

    with launch("evaluation.garage.conversion_process", limits=CONVERTER) as process:
        write_frame(process.stdin, question, process.deadline)
        answer = read_frame(process.stdout, limit, process.deadline)

The module is imported, locked, and then its ``main(frames_in, frames_out)`` is called with two descriptors: see
:mod:`.enter`. Below the minimum level nothing is started.
"""

from collections.abc import Sequence
from pathlib import Path

from paddock.errors import PlatformFault
from paddock.exact import LARGE_PAGES

from .limits import Limits
from .probe import require
from .process import SandboxedProcess
from .start import LEVEL_LOCK, start


def launch(
    module: str,
    *,
    limits: Limits,
    arguments: Sequence[str] = (),
    pass_fds: Sequence[int] = (),
    python_path: Sequence[str | Path] = (),
    level: int | None = None,
    random: bool = False,
    memory: str = LARGE_PAGES,
) -> SandboxedProcess:
    """Start ``module`` (such as ``evaluation.*``, or something below ``python_path``) in the sandbox.

    ``arguments`` become ``sys.argv[1:]``; ``pass_fds`` keep their numbers inside. ``python_path``: further directories
    of code. Files can be read until the lock only. ``level``: instead of the best that this host offers. ``random``:
    the kernel's random numbers can be read until the lock (torch's import does). ``memory``: how glibc gets it
    (:mod:`paddock.exact`).

    Raises PlatformFault ``sandbox_unavailable`` below the minimum level and ``sandbox_failed`` when the process cannot
    be started. A lock that fails later shows as an exit status (:data:`.lock.EXIT_NOT_LOCKED`).
    """
    best = require()
    level = best if level is None else level
    if not LEVEL_LOCK <= level <= best:
        raise PlatformFault("sandbox_unavailable", level=level, minimum=LEVEL_LOCK)
    try:
        return start(module, limits, level, arguments, pass_fds, python_path, random, memory)
    except (OSError, ValueError, RuntimeError) as error:
        raise PlatformFault("sandbox_failed", detail=str(error)) from error
