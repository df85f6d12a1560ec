"""Which files an archive may hold, by exact name, whatever the archive format.

A car's archive, as the console and DeepRacer-for-Cloud write it, holds ``agent/model.pb``, ``model_metadata.json`` and
two files of RL-Coach (deepracer.md 1.1). Packing tools add a leading ``./``, one folder around everything, folder
entries and their own droppings (``.DS_Store``, ``__MACOSX/``, ``._*``). Nothing else is let in.
"""

from __future__ import annotations

import re

from faults import UserFault

from .limits import PackageLimits
from .wire import printable

METADATA = "model_metadata.json"
_MODEL = re.compile(r"(agent(_\d{1,3})?/)?model\.pb\Z")
_ONNX = re.compile(r"[^/]{1,200}\.onnx\Z", re.IGNORECASE)
_COACH = re.compile(r"worker_\d{1,4}\.[A-Za-z0-9_.]{1,160}\.(csv|json)\Z")
_DROPPINGS = re.compile(r"(.*/)?(\.DS_Store|Thumbs\.db|desktop\.ini|\._[^/]*)\Z")
_HARMLESS = {"reward_function.py", "hyperparameters.json", "training_params.yaml", "README.md", "LICENSE"}

SKIP, MODEL = "skip", "model"


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
        raise UserFault("unexpected_member", member=printable(raw.decode("utf-8", "replace")))
    return name


class Expected:
    """Decides, member by member, what to read. One instance for one archive."""

    def __init__(self, limits: PackageLimits) -> None:
        self._limits = limits
        self._names: set[str] = set()
        self._roles: set[str] = set()
        self._top: str | None = None
        self._members = 0

    def folder(self, raw: bytes) -> None:
        """Check a folder entry. Folders are counted and otherwise ignored."""
        self._count()
        clean_name(raw, self._limits)

    def file(self, raw: bytes) -> str:
        """:data:`SKIP`, :data:`METADATA` or :data:`MODEL` for the file of this name.

        Raises UserFault ``unexpected_member``, ``duplicate_member`` or ``too_many_members``.
        """
        self._count()
        name = clean_name(raw, self._limits)
        if name.startswith("__MACOSX/") or _DROPPINGS.match(name):
            return SKIP
        if name.casefold() in self._names:
            raise UserFault("duplicate_member", member=printable(name))
        self._names.add(name.casefold())
        top, role = "", self._role(name)
        if role is None and "/" in name:
            top, rest = name.split("/", 1)
            role = self._role(rest)
        if role is None or self._top not in (None, top):
            raise UserFault("unexpected_member", member=printable(name))
        self._top = top
        if role != SKIP:
            if role in self._roles:
                raise UserFault("duplicate_member", member=printable(name))
            self._roles.add(role)
        return role

    def _count(self) -> None:
        self._members += 1
        if self._members > self._limits.archive_members:
            raise UserFault("too_many_members", limit=self._limits.archive_members)

    @staticmethod
    def _role(name: str) -> str | None:
        if name == METADATA:
            return METADATA
        if _MODEL.match(name) or _ONNX.match(name):
            return MODEL
        if _COACH.match(name) or name in _HARMLESS:
            return SKIP
        return None
