"""Checks the member names of an archive before anything is read."""

# Packing tools add a leading ``./``, folders around everything, folder entries and their own files (``.DS_Store``,
# ``__MACOSX/``, ``._*``). :mod:`.choose` selects the needed files when all names are known.

import re
from collections.abc import Callable

from paddock.errors import UserFault
from paddock.network.wire import is_space, printable

from .limits import PackageLimits

_DROPPINGS = re.compile(r"(.*/)?(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*)\Z")
_JOINERS = "\u200c\u200d"  # within words of some scripts, and within emoji


def decoded(raw: bytes) -> str:
    """A member's name as text: UTF-8, or else the code page of Windows and old tools."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("cp437").replace("\xa0", "\ufffd").replace("\\/", "/")  # half of a Japanese letter


def clean_name(raw: bytes, limits: PackageLimits) -> str:
    """The member's plain path without a leading ``./``. Refuses path tricks; a backslash separates folders."""
    name = decoded(raw).replace("\\", "/")
    while name.startswith("./"):
        name = name[2:]
    parts = name.rstrip("/").split("/")
    if (
        len(raw) > limits.member_name_bytes
        or not all(letter.isprintable() or letter in _JOINERS or is_space(letter) for letter in name)
        or (name not in ("", ".") and any(part in ("", ".", "..") for part in parts))
        or (not name and raw not in (b"./", b".", b".\\"))
        or re.match(r"[A-Za-z]:", name)
    ):
        raise UserFault("unexpected_member", member=printable(decoded(raw[:1000])))
    return name


class Catalogue:
    """What an archive holds: ``sizes`` by clean name, in the archive's order, without droppings and folders."""

    def __init__(self, limits: PackageLimits) -> None:
        self._limits = limits
        self._folded: dict[str, str] = {}
        self._members = 0
        self.sizes: dict[str, int] = {}

    def folder(self, raw: bytes) -> None:
        """Check a folder entry. Folders are counted and otherwise ignored."""
        self._count()
        clean_name(raw, self._limits)

    def file(self, raw: bytes, size: int, is_copy: Callable[[str], bool]) -> str | None:
        """The clean name of a file; None for a dropping and for an equal copy of a file that is already here, which
        ``is_copy`` (the earlier one's name) tells.

        Raises UserFault ``unexpected_member``, ``duplicate_member`` or ``too_many_members``.
        """
        self._count()
        name = clean_name(raw, self._limits)
        if name.startswith("__MACOSX/") or _DROPPINGS.match(name):
            return None
        first = self._folded.setdefault(name.casefold(), name)
        if first in self.sizes:
            if self.sizes[first] == size and is_copy(first):
                return None
            raise UserFault("duplicate_member", member=printable(name))
        self.sizes[name] = size
        return name

    def _count(self) -> None:
        self._members += 1
        if self._members > self._limits.archive_members:
            raise UserFault("too_many_members", limit=self._limits.archive_members)
