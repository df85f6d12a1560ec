"""The acting racer or command, and its channel. Loads nothing of Django's models."""

import sys
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from django.http import HttpRequest

from ..logs.lines import NONE, program_of, request_id

PAGE, API, ADMIN, COMMAND = "page", "api", "admin", "command"
# programs of manage.py that act for nobody
_SERVERS = frozenset({"run", "runserver", "test", "manage"})

current_request: ContextVar[HttpRequest | None] = ContextVar("current_request", default=None)


@dataclass(frozen=True)
class Acting:
    """``actor``: a racer's id, None for a command; ``program``: the command, or the first characters of the token;
    ``network``: the client's address without its last part."""

    actor: int | None
    channel: str
    program: str = ""
    request: str = ""
    network: str = ""


def acting(by: Any = None) -> Acting | None:
    """The one that acts: ``by``, else the racer of the request, else the command. None for tasks, and for guests."""
    request = current_request.get()
    if request is None:
        command = _command()
        return Acting(getattr(by, "pk", None), COMMAND, command) if command else None
    user = by if by is not None else getattr(request, "user", None)
    if user is None or user.pk is None:
        return None
    token = getattr(getattr(request, "auth", None), "token_key", "")
    path = request.path_info
    channel = API if path.startswith("/api/") else ADMIN if path.startswith("/admin/") else PAGE
    number = request_id.get()
    return Acting(user.pk, channel, token, "" if number == NONE else number, _network(request))


def _command() -> str:
    if Path(sys.argv[0] if sys.argv else "").stem != "manage":
        return ""
    name = program_of(tuple(sys.argv))
    return "" if name in _SERVERS else name


def _network(request: HttpRequest) -> str:
    """The client's network: three of the four numbers of IPv4, 48 bits of IPv6."""
    from ipaddress import ip_network

    from ..rate_limits import address_of

    address = address_of(request)
    return str(ip_network(f"{address}/{24 if '.' in address else 48}", strict=False)) if address else ""
