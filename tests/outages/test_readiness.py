"""Readiness answers within its bound, with the names of all that hangs, and says the same in every web process."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

import pytest

from config.operations.health import KEPT_S
from tests.shared import CHECKOUT
from tests.streams.process import free_port

pytestmark = pytest.mark.slow
BOUND_S = 4.0  # 3 s and what a busy machine takes
OF_DATABASE = {"database", "writes", "migrations", "storage", "workers", "messengers", "scheduler", "queue"}


@pytest.fixture
def silent() -> Iterator[str]:
    """The address of a server that takes every connection and never answers."""
    with socket.create_server(("127.0.0.1", 0), backlog=512) as listening:
        yield f"127.0.0.1:{listening.getsockname()[1]}"


@contextmanager
def web(data: Path, processes: int, **variables: str) -> Iterator[tuple[int, Callable[[str], tuple[int, str]]]]:
    """The web server; its process id, and how to ask it."""
    port = free_port()
    command = [sys.executable, "-m", "config.web", "--port", str(port), "--processes", str(processes)]
    settings = {**os.environ, "PADDOCK_DATA": str(data), "DJANGO_SETTINGS_MODULE": "config.settings", **variables}

    def ask(path: str) -> tuple[int, str]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=30) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    process = subprocess.Popen(command, cwd=CHECKOUT, env=settings, start_new_session=True)
    try:
        until = monotonic() + 60
        while monotonic() < until:
            try:
                ask("/health/live")
                break
            except OSError:
                sleep(0.2)
        yield process.pid, ask
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def threads_of(pid: int) -> int:
    """How many threads the children of a process have together."""
    children = [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return sum(len(list(Path(f"/proc/{child}/task").iterdir())) for child in children)


def test_hanging_parts_are_named_within_the_bound(silent: str, tmp_path: Path, new_data: Callable[..., Path]) -> None:
    variables = {
        "DATABASE_URL": f"postgres://paddock:paddock@{silent}/paddock",
        "CELERY_BROKER_URL": f"redis://{silent}/0",
        "CACHE_URL": f"redis://{silent}/1",
        "STORAGE": "s3://paddock-files",
        "AWS_S3_ENDPOINT_URL": f"http://{silent}",
        "AWS_ACCESS_KEY_ID": "a-key",
        "AWS_SECRET_ACCESS_KEY": "a-secret",
    }
    threads = []
    with web(new_data(tmp_path / "data"), 1, **variables) as (pid, ask):
        for _ in range(4):
            began = monotonic()
            status, text = ask("/health/ready")
            assert monotonic() - began < BOUND_S
            found = json.loads(text)
            failing = {name for name, good in found.items() if good is False}
            assert status == 503 and failing >= OF_DATABASE | {"broker", "cache", "storage"}, found
            assert found["disk"] is True and 0 <= found["age_s"] < 10
            threads.append(threads_of(pid))
            sleep(max(0.0, KEPT_S + 0.1 - found["age_s"]))  # until the next one looks anew
    assert threads[-1] == threads[1], "look-ups that hang pile up"


def test_web_processes_agree(tmp_path: Path, new_data: Callable[..., Path]) -> None:
    data = new_data(tmp_path / "data")
    files, aside = data / "files", tmp_path / "aside"
    files.mkdir(exist_ok=True)
    said: list[tuple[float, bool]] = []  # when the look was taken, and what it found of the storage
    with web(data, 2) as (_, ask):
        for number in range(70):  # each state that comes lasts longer than an answer is shared
            if number == 10:
                files.rename(aside)
                files.write_text("in the way")
            elif number == 40:
                files.unlink()
                aside.rename(files)
            found = json.loads(ask("/health/ready")[1])
            said.append((monotonic() - found["age_s"], found["storage"]))
            sleep(0.2)
    assert {good for _, good in said} == {True, False}
    for (taken, good), (before, other) in zip(said[1:], said, strict=False):
        assert taken > before - 0.3, "an older answer came after a newer one"
        assert good == other or taken > before + 4, "two answers contradict each other"
