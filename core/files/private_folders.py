"""Folders that only their owner may read. Imports no Django."""

import stat
from pathlib import Path


def make_private_folder(folder: Path) -> None:
    """Create ``folder`` and all missing parents with mode 0700, which ``Path.mkdir`` gives to the last folder only."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    for parent in reversed(missing):
        parent.mkdir(mode=0o700, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)  # raises FileExistsError for a file


def is_private_to(folder: Path, uid: int) -> bool:
    """Whether ``folder`` is a real directory, not a link, that user ``uid`` owns."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == uid
