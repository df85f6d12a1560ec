"""The address of the site that ``manage.py run`` starts."""

from __future__ import annotations

import os
from argparse import ArgumentError, ArgumentParser
from collections.abc import Sequence

HOST, PORT = "127.0.0.1", 8000


def take_own_address(arguments: Sequence[str]) -> None:
    """Make the address where ``run`` with these arguments listens the site's, unless the operator has named one.

    Before the settings are read: what ``run`` starts has the same ones. What is wrong with the arguments is for the
    command to say.
    """
    parser = ArgumentParser(add_help=False, exit_on_error=False)
    parser.add_argument("--host", default=HOST)
    parser.add_argument("--port", default=PORT, type=port)
    try:
        given, _ = parser.parse_known_args(arguments)
    except ArgumentError:
        return
    os.environ.setdefault("PADDOCK_SITE_URL", shown(given.host, given.port))


def shown(host: str, port: int) -> str:
    """Where a browser of this machine finds what listens on a host and a port."""
    host = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def port(text: str) -> int:
    """A number of a port. ValueError for what is none."""
    number = int(text)
    if not 0 < number < 65536:
        raise ValueError
    return number
