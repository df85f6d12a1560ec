"""The arguments that every command shares: output, site and race."""

import argparse
import json
import os
import re
import sys
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import Any

from paddock.errors import PlatformFault, UserFault

from .files import UNWRITABLE, file_faults
from .settings import SITE, Settings, address, split_page
from .showing import Speaker, lap_time, table
from .site import Served, Site

ASK_EVERY_S = 1.0
ID = re.compile(r"[a-z0-9]{12}")
Command = Callable[["Call", argparse.Namespace], int]


@dataclass
class Call:
    """A call of the command. ``given_site``: its option ``--site``, or nothing. ``asked_site``: the site of the last
    request."""

    speaker: Speaker
    given_site: str = ""
    asked_site: str = ""

    @cached_property
    def settings(self) -> Settings:
        """The stored settings. Raises UserFault("home_file_unreadable")."""
        return Settings.read()

    def site_named(self) -> str:
        """The site of this call's option or environment, else of the last login, or nothing."""
        return self.given_site or os.environ.get(SITE, "") or self.settings.usual

    def address(self, given: str = "") -> str:
        """The address of the given site, else of :meth:`site_named`. Raises UserFault("site_missing"),
        ("site_address")."""
        if not (where := given or self.site_named()):
            raise UserFault("site_missing")
        self.asked_site = address(where)
        return self.asked_site

    def site(self, of_page: str = "") -> Site:
        """The site of a page's address, else the call's, with its token. Raises as :meth:`address`."""
        where = self.address(of_page)
        return Site(where, self.settings.token_for(where))


def race_of(asked: Call, given: str) -> tuple[Site, str]:
    """The site and the slug of a race, given as its slug or its page's address. Raises UserFault("race_wanted")."""
    where, slug = split_page(given, "races")
    if not slug:
        raise UserFault("race_wanted", given=given)
    return asked.site(where), slug


def named(asked: Call, given: str, *kinds: str) -> tuple[Site, str]:
    """The site and the id in a page's address, or a bare id; ``kinds``: the words before the id in addresses. Raises
    UserFault("home_command_line")."""
    for kind in kinds:
        where, name = split_page(given, kind)
        if ID.fullmatch(name):
            return asked.site(where), name
    raise UserFault("home_command_line", problem=f"{given} is neither an id nor the address of a page")


def pairs(given: list[str]) -> dict[str, object]:
    """Options ``NAME=VALUE`` as an object; a value is JSON or a plain word. ``a.b=1`` sets ``b`` within ``a``.
    Raises UserFault("home_command_line")."""
    values: dict[str, object] = {}
    for text in given:
        name, equals, value = text.partition("=")
        *outer, last = name.split(".")
        if not equals or not all((*outer, last)):
            raise UserFault("home_command_line", problem=f"{text} is not NAME=VALUE")
        inside = values
        for each in outer:
            part = inside.setdefault(each, {})
            if not isinstance(part, dict):
                raise UserFault("home_command_line", problem=f"{text} sets a part of what another option sets")
            inside = part
        try:
            inside[last] = json.loads(value)
        except ValueError:
            inside[last] = value
    return values


def confirmed(options: argparse.Namespace, question: str) -> None:
    """Ask for confirmation unless ``--yes`` is given. Raises UserFault("home_not_confirmed")."""
    if options.yes:
        return
    if not sys.stdin.isatty() or input(f"{question} [y/N] ").strip().lower() not in ("y", "yes"):
        raise UserFault("home_not_confirmed")


def wait_until(
    asked: Call,
    read: Callable[[], Served],
    over: Collection[str],
    progress: Callable[[Served], tuple[str, float | None]],
    patience_s: float,
    url: str,
) -> Served:
    """The answer of ``read`` when its state is one of ``over``; ``progress`` describes the others.

    Raises PlatformFault("wait_over"), and what a request raises."""
    until = time.monotonic() + patience_s
    while True:
        found = read()
        if found["state"] in over:
            return found
        asked.speaker.progress(*progress(found))
        if time.monotonic() >= until:
            raise PlatformFault("wait_over", seconds=round(patience_s), url=url)
        time.sleep(ASK_EVERY_S)


def listed(asked: Call, found: Sequence[Any], none: str, *columns: str) -> int:
    """Show a list; the exit status. ``columns``: ``head:path`` with the path of a value in an answer, such as
    ``track:track.slug``; the path alone where it is the head, too. ``none``: the text of an empty list."""
    paths = [column.rpartition(":")[2] for column in columns]
    rows = [[_shown(path, reduce(getitem, path.split("."), one)) for path in paths] for one in found]
    asked.speaker.result(found, table([column.partition(":")[0] for column in columns], rows, none))
    return 0


def _shown(path: str, value: Any) -> Any:
    """A value of the API in the unit that its name ends with."""
    if path.endswith("_ms"):
        return lap_time(value)
    if path.endswith("_m"):
        return "-" if value is None else f"{value:.2f} m"
    return f"{value[:16]}Z" if path.endswith("_at") else value


def written(asked: Call, to: Path, data: bytes) -> int:
    """Write a file and report it; the exit status. Raises UserFault("home_file_unwritable")."""
    with file_faults(UNWRITABLE, to):
        to.write_bytes(data)
    asked.speaker.result({"file": str(to), "bytes": len(data)}, f"{to}  {len(data) / 1e6:.2f} MB")
    return 0
