"""The names in an archive, whatever its format: checked one by one, before anything is read.

Packing tools add a leading ``./``, folders around everything, folder entries and their own droppings (``.DS_Store``,
``__MACOSX/``, ``._*``). Which of the files are wanted is decided when all names are known: see :mod:`.choose`.
"""

from __future__ import annotations

import re

from paddock.errors import UserFault
from paddock.network.wire import printable

from .limits import PackageLimits

_DROPPINGS = re.compile(r"(.*/)?(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*)\Z")


def clean_name(raw: bytes, limits: PackageLimits) -> str:
    """The member's path in plain form, without a leading ``./``. Refuses every path trick."""
    try:
        name = raw.decode("utf-8")
    except UnicodeDecodeError:
        name = ""
    while name.startswith("./"):
        name = name[2:]
    parts = name.rstrip("/").split("/")
    if (
        len(raw) > limits.member_name_bytes
        or not name.isprintable()
        or "\\" in name
        or (name not in ("", ".") and any(part in ("", ".", "..") for part in parts))
        or (not name and raw not in (b"./", b"."))
        or re.match(r"[A-Za-z]:", name)
    ):
        raise UserFault("unexpected_member", member=printable(raw[:1000].decode("utf-8", "replace")))
    return name


class Catalogue:
    """What an archive holds: ``sizes`` by clean name, in the archive's order, without droppings and folders."""

    def __init__(self, limits: PackageLimits) -> None:
        self._limits = limits
        self._folded: set[str] = set()
        self._members = 0
        self.sizes: dict[str, int] = {}

    def folder(self, raw: bytes) -> None:
        """Check a folder entry. Folders are counted and otherwise ignored."""
        self._count()
        clean_name(raw, self._limits)

    def file(self, raw: bytes, size: int) -> str | None:
        """The clean name of a file; None for a dropping.

        Raises UserFault ``unexpected_member``, ``duplicate_member`` or ``too_many_members``.
        """
        self._count()
        name = clean_name(raw, self._limits)
        if name.startswith("__MACOSX/") or _DROPPINGS.match(name):
            return None
        if name.casefold() in self._folded:
            raise UserFault("duplicate_member", member=printable(name))
        self._folded.add(name.casefold())
        self.sizes[name] = size
        return name

    def _count(self) -> None:
        self._members += 1
        if self._members > self._limits.archive_members:
            raise UserFault("too_many_members", limit=self._limits.archive_members)
