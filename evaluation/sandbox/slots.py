"""Limits how many admissions, exports and the like run at a time on one machine, over all web workers."""

import contextlib
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from core.files.private_folders import make_private_folder
from paddock.errors import PlatformFault

from .claims import claim, default_directory

_POLL_S = 0.05
_RACERS = 64  # racers share this many files: now and then two racers must take turns


@contextlib.contextmanager
def upload_slot(
    count: int, wait_s: float, directory: Path | None = None, *, waiting: int = 2, racer_pk: int | None = None
) -> Iterator[None]:
    """Hold one of ``count`` slots. Raises PlatformFault ``upload_busy`` if none is free within ``wait_s`` seconds.

    At most ``waiting`` others wait, and later calls are refused at once: each waiting call holds a thread of the web
    server. ``racer_pk``: each racer gets one slot at a time.
    """
    directory = directory or default_directory()
    make_private_folder(directory)
    deadline = time.monotonic() + wait_s
    with contextlib.ExitStack() as held:
        if not _take_slot(held, directory, count, racer_pk):
            with contextlib.ExitStack() as bench:
                if not _lock_one(bench, directory, "waiting", range(waiting)):
                    raise PlatformFault("upload_busy")
                while not _take_slot(held, directory, count, racer_pk):
                    if time.monotonic() >= deadline:
                        raise PlatformFault("upload_busy")
                    time.sleep(_POLL_S)
        yield


def _take_slot(held: contextlib.ExitStack, directory: Path, count: int, racer_pk: int | None) -> bool:
    with contextlib.ExitStack() as taken:
        if racer_pk is not None and not _lock_one(taken, directory, "racer", [racer_pk % _RACERS]):
            return False
        if not _lock_one(taken, directory, "upload", range(count)):
            return False
        held.push(taken.pop_all())
        return True


def _lock_one(held: contextlib.ExitStack, directory: Path, name: str, numbers: Iterable[int]) -> bool:
    """Lock the first free of these files until ``held`` ends; False when all are taken."""
    for number in numbers:
        if (taken := claim(f"{name}-{number}", directory)) is not None:
            held.enter_context(taken)
            return True
    return False
