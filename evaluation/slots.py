"""At most so many admissions at a time on one machine, over all web workers.

A slot is an exclusive ``flock`` on a file: the kernel gives it back when its holder dies.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from core.private_folders import make_private_folder
from paddock.errors import PlatformFault

_POLL_S = 0.05
_RACERS = 64  # racers share this many files: now and then two racers must take turns
_CHECKOUT = Path(__file__).resolve().parent.parent


def default_directory() -> Path:
    """``locks`` in the data directory (``PADDOCK_DATA``, or ``data`` in the checkout)."""
    return Path(os.environ.get("PADDOCK_DATA") or _CHECKOUT / "data") / "locks"


@contextlib.contextmanager
def upload_slot(
    count: int, wait_s: float, directory: Path | None = None, *, waiting: int = 2, who: int | None = None
) -> Iterator[None]:
    """Hold one of ``count`` slots. Raises PlatformFault ``upload_busy`` if none is free within ``wait_s`` seconds.

    At most ``waiting`` others wait, and whoever comes then is turned away at once: each of them holds a thread of the
    web server, and the site must answer others all the while. ``who``: a racer's number; each gets one slot at a time.
    """
    directory = directory or default_directory()
    make_private_folder(directory)
    deadline = time.monotonic() + wait_s
    with contextlib.ExitStack() as held:
        if not _take_slot(held, directory, count, who):
            with contextlib.ExitStack() as bench:
                if not _lock_one(bench, directory, "waiting", range(waiting)):
                    raise PlatformFault("upload_busy")
                while not _take_slot(held, directory, count, who):
                    if time.monotonic() >= deadline:
                        raise PlatformFault("upload_busy")
                    time.sleep(_POLL_S)
        yield


def _take_slot(held: contextlib.ExitStack, directory: Path, count: int, who: int | None) -> bool:
    with contextlib.ExitStack() as taken:
        if who is not None and not _lock_one(taken, directory, "racer", [who % _RACERS]):
            return False
        if not _lock_one(taken, directory, "upload", range(count)):
            return False
        held.push(taken.pop_all())
        return True


def _lock_one(held: contextlib.ExitStack, directory: Path, name: str, numbers: Iterable[int]) -> bool:
    """Lock the first free of these files until ``held`` ends; False when all are taken."""
    for number in numbers:
        fd = os.open(directory / f"{name}-{number}", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(fd)
            continue
        held.callback(os.close, fd)
        return True
    return False
