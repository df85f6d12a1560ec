"""Brokers that tests start for themselves and stop again: Valkey and Redis, on unix sockets."""

from __future__ import annotations

import ctypes
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

from config.serving import broker

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
def running(command: Sequence[str], ready) -> Iterator[subprocess.Popen]:
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
        process.terminate()
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
