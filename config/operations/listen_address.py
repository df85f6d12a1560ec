"""Derives the address of the site from the options of ``manage.py run``."""

import os
from argparse import ArgumentError, ArgumentParser
from collections.abc import Sequence

HOST, PORT = "127.0.0.1", 8000


def set_site_url(arguments: Sequence[str]) -> None:
    """Derive the site's address from the arguments of ``run``, unless the operator has set one. Call it before the
    settings are read. Invalid arguments are left to the command."""
    parser = ArgumentParser(add_help=False, exit_on_error=False)
    parser.add_argument("--host", default=HOST)
    parser.add_argument("--port", default=PORT, type=port)
    try:
        given, _ = parser.parse_known_args(arguments)
    except ArgumentError:
        return
    os.environ.setdefault("PADDOCK_SITE_URL", browser_url(given.host, given.port))


def browser_url(host: str, port: int) -> str:
    host = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def port(text: str) -> int:
    number = int(text)
    if not 0 < number < 65536:
        raise ValueError
    return number
