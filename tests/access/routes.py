"""The routes of the site, and the table of who may use them (``table.txt``)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from urllib.parse import urlsplit

from django.urls import URLPattern, URLResolver, get_resolver, resolve

from tests.access.cast import VIEWERS, Cast

TABLE = Path(__file__).with_name("table.txt")
FOLLOW = "FOLLOW"  # a topic of the stream, answered by yes or no
# the admin site and passkeys have tests of their own, readiness depends on the machine, and the last route of the API
# is for no page
ELSEWHERE = re.compile(r"admin/|accounts/2fa/webauthn/keys/|health/ready|api/\(")


@dataclass(frozen=True)
class Row:
    """A request, with words in braces for what its address names, and the answer to each of the cast.

    An answer is a status or the page that a browser is sent to (``login``, ``2fa``, ``class``).
    """

    method: str
    address: str
    answers: dict[str, str]
    route: str = ""
    view: type | None = None  # of the API

    def __str__(self) -> str:
        return f"{self.method:6} {self.address:60} " + " ".join(f"{self.answers[v]:9}" for v in VIEWERS).rstrip()


def rows(cast: Cast) -> list[Row]:
    """The table."""
    found = []
    for line in TABLE.read_text().splitlines():
        if line and not line.startswith("#"):
            method, address, *answers = line.split()
            assert len(answers) == len(VIEWERS), line
            found.append(row_of(cast, method, address, dict(zip(VIEWERS, answers, strict=True))))
    return found


def row_of(cast: Cast, method: str, address: str, answers: dict[str, str]) -> Row:
    if method == FOLLOW:
        return Row(method, address, answers, f"{FOLLOW} {address.partition(':')[0]}")
    return Row(method, address, answers, *_route_and_view(urlsplit(cast.fill(address)).path))


@cache
def _route_and_view(path: str) -> tuple[str, type | None]:
    match = resolve(path)
    return match.route.replace("^", ""), getattr(match.func, "cls", None)


@cache
def routes() -> dict[str, type | None]:
    """Every route outside the admin site, and the class of its view if it belongs to the API."""
    found = _routes(get_resolver().url_patterns)
    return {route: getattr(pattern.callback, "cls", None) for route, pattern in found if not ELSEWHERE.match(route)}


def _routes(patterns: Iterable[URLPattern | URLResolver], before: str = "") -> Iterator[tuple[str, URLPattern]]:
    for pattern in patterns:
        route = before + str(pattern.pattern)
        if isinstance(pattern, URLResolver):
            yield from _routes(pattern.url_patterns, route)
        else:
            yield route.replace("^", ""), pattern
