"""Claims of resources of one machine, such as a core or a user id: locks on files in a private folder.

The kernel releases a lock when its holder dies. Other accounts can neither open nor replace the files.
"""

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from core.files.private_folders import is_private_to, make_private_folder

_CHECKOUT = Path(__file__).resolve().parent.parent.parent


class Claim:
    """A claimed name. Close it to give it back; the end of the process does so, too."""

    def __init__(self, fd: int) -> None:
        self._fd: int | None = fd

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def close(self) -> None:
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None


class Candidate(Claim):
    """A name for repeated attempts: its file is opened once. Raises OSError where there is no private folder."""

    def __init__(self, name: str, folder: Path | None = None) -> None:
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        super().__init__(os.open((folder or private_folder()) / name, flags, 0o600))

    def claim(self) -> Claim | None:
        """The claimed name, once; None while somebody has it."""
        if self._fd is None:
            raise ValueError("claimed already, or given up")
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None
        fd, self._fd = self._fd, None
        return Claim(fd)


def claim(name: str, folder: Path | None = None) -> Claim | None:
    """Claim ``name`` on this machine; None when somebody has it. Raises OSError where there is no private folder."""
    with Candidate(name, folder) as candidate:
        return candidate.claim()


def default_directory() -> Path:
    """``locks`` in the data directory (``PADDOCK_DATA``, or ``data`` in the checkout)."""
    return Path(os.environ.get("PADDOCK_DATA") or _CHECKOUT / "data") / "locks"


def private_folder() -> Path:
    """The first folder that is, or can be made, private to this user. Raises OSError when there is none."""
    for folder in _places():
        with contextlib.suppress(OSError):
            make_private_folder(folder)
            if is_private_to(folder, os.geteuid()):
                folder.chmod(0o700)
                return folder
    raise OSError(f"no folder can be made that is private to this user: tried {', '.join(map(str, _places()))}")


def _places() -> Iterator[Path]:
    name = "paddock-sandbox"
    if os.geteuid() == 0:
        yield Path("/run") / name
    elif runtime := os.environ.get("XDG_RUNTIME_DIR"):
        yield Path(runtime) / name
    yield default_directory() / "sandbox"
    yield Path(tempfile.gettempdir()) / f"{name}-{os.geteuid()}"
