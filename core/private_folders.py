"""Folders that only their owner may read. Imports no Django: the sandbox and benchmarks use it before any settings."""

from __future__ import annotations

import stat
from pathlib import Path


def make_private_folder(folder: Path) -> None:
    """Create ``folder`` with every missing parent, readable by this user only; keep the mode of folders that exist.

    ``Path.mkdir(mode=0o700, parents=True)`` gives the mode to the last folder only: a parent created on the way would
    be open to every user of the machine. Raises OSError as ``Path.mkdir`` does.
    """
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    for parent in reversed(missing):
        parent.mkdir(mode=0o700, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)  # raises FileExistsError for a file


def is_private_to(folder: Path, uid: int) -> bool:
    """Whether ``folder`` is a real directory, not a link, that user ``uid`` owns."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == uid
