"""Locks the data folder for one program at a time."""

import fcntl
import os
from pathlib import Path
from typing import IO

from django.core.management.base import CommandError


def hold_data(path: Path) -> IO[str]:
    """Lock ``path`` for the life of this process. Raises CommandError when another process holds it."""
    file = path.open("a+")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.seek(0)
        raise CommandError(
            f"Paddock is already running on {path.parent} (process {file.read().strip() or 'unknown'}). "
            "Stop that one first, or name another folder with PADDOCK_DATA."
        ) from None
    file.truncate(0)
    file.write(f"{os.getpid()}\n")
    file.flush()
    return file
