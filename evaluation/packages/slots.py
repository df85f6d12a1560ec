"""At most so many admissions at a time on one machine, over all web workers.

A slot is an exclusive ``flock`` on a file: the kernel gives it back when its holder dies.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path

from faults import PlatformFault

_POLL_S = 0.05
_CHECKOUT = Path(__file__).resolve().parent.parent.parent


def default_directory() -> Path:
    """``locks`` in the data directory (``PADDOCK_DATA``, or ``data`` in the checkout)."""
    return Path(os.environ.get("PADDOCK_DATA") or _CHECKOUT / "data") / "locks"


@contextlib.contextmanager
def upload_slot(count: int, wait_s: float, directory: Path | None = None) -> Iterator[None]:
    """Hold one of ``count`` slots. Raises PlatformFault ``upload_busy`` if none is free within ``wait_s`` seconds."""
    directory = directory or default_directory()
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    deadline = time.monotonic() + wait_s
    while True:
        for number in range(count):
            fd = os.open(directory / f"upload-{number}", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(fd)
                continue
            try:
                yield
            finally:
                os.close(fd)
            return
        if time.monotonic() >= deadline:
            raise PlatformFault("upload_busy")
        time.sleep(_POLL_S)
