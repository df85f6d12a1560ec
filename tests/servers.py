"""Servers that tests start for themselves and stop again: Valkey, Redis, PostgreSQL. All on unix sockets."""

from __future__ import annotations

import ctypes
import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from urllib.parse import quote

import pytest

from league import broker

START_S = 60.0


@contextmanager
def valkey(folder: Path) -> Iterator[str]:
    """The bundled server, as the run command starts it; yields its address for Celery."""
    path = broker.socket_path(folder)
    with running(broker.server_command(folder, path), lambda: answers(path)):
        yield broker.broker_url(path)


@contextmanager
def redis(folder: Path) -> Iterator[str]:
    """A Redis server; yields its address for Celery."""
    path = broker.socket_path(folder)
    options = ["--port", "0", "--unixsocket", str(path), "--save", "", "--dir", str(folder)]
    with running(["redis-server", *options], lambda: answers(path)):
        yield broker.broker_url(path)


@contextmanager
def postgres(folder: Path) -> Iterator[str]:
    """A PostgreSQL server that cares for no power loss; yields its DATABASE_URL (of the database ``postgres``)."""
    data = folder / "data"
    owner = _unprivileged()
    if owner:
        os.chown(folder, owner.pw_uid, owner.pw_gid)
    initdb = [postgres_program("initdb"), "-D", str(data), "-U", "postgres", "--auth=trust", "-E", "UTF8", "--no-sync"]
    subprocess.run([*_as(owner), *initdb], check=True, capture_output=True, cwd=folder)
    options = {"listen_addresses": "", "unix_socket_directories": str(folder), "fsync": "off", "max_connections": "60"}
    command = [postgres_program("postgres"), "-D", str(data)]
    command += [part for name, value in options.items() for part in ("-c", f"{name}={value}")]
    with running([*_as(owner), *command], lambda: answers(folder / ".s.PGSQL.5432"), signal.SIGINT):
        yield f"postgres://postgres@{quote(str(folder), safe='')}/postgres"


def postgres_program(name: str) -> str:
    """The path of a PostgreSQL program; skips the test where there is none."""
    found = shutil.which(name) or next((str(path) for path in Path("/usr/lib/postgresql").glob(f"*/bin/{name}")), None)
    if found is None:
        pytest.skip("PostgreSQL is not installed")
    return found


@contextmanager
def running(command: Sequence[str], ready, stop_signal: int = signal.SIGTERM) -> Iterator[subprocess.Popen]:
    """A server, from when it is ``ready()`` to the end of the block. It ends with the tests' process, too."""
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=_end_with_tests,
        start_new_session=True,
    )
    try:
        deadline = monotonic() + START_S
        while not ready():
            if process.poll() is not None or monotonic() > deadline:
                raise RuntimeError(f"{command[0]} did not start")
            sleep(0.02)
        yield process
    finally:
        process.send_signal(stop_signal)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def short_folder() -> Iterator[Path]:
    """A folder whose path is short enough for a socket in it."""
    folder = Path(tempfile.mkdtemp(prefix="pt-", dir="/tmp"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def answers(path: Path) -> bool:
    """Whether something listens on a unix socket."""
    with socket.socket(socket.AF_UNIX) as client:
        return client.connect_ex(str(path)) == 0


def _end_with_tests() -> None:
    ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG


def _unprivileged() -> pwd.struct_passwd | None:
    """Somebody to run PostgreSQL as, which refuses to run as root."""
    if os.getuid() != 0:
        return None
    for name in ("postgres", "nobody"):
        try:
            return pwd.getpwnam(name)
        except KeyError:
            continue
    pytest.skip("PostgreSQL needs a user other than root")


def _as(owner: pwd.struct_passwd | None) -> list[str]:
    if owner is None:
        return []
    return ["setpriv", f"--reuid={owner.pw_uid}", f"--regid={owner.pw_gid}", "--clear-groups"]
