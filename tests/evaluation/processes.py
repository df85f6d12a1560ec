"""Starting real workers on the tests' own database, and looking at what processes are left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from urllib.parse import quote

from django.conf import settings
from django.db import connection

from tests.shared import CHECKOUT


def database_url() -> str:
    """The address of the database that the running test uses, for another process."""
    database = connection.settings_dict
    if connection.vendor == "sqlite":
        return f"sqlite:///{database['NAME']}"
    return f"postgres://{database['USER']}@{quote(database['HOST'], safe='')}/{database['NAME']}"


def environment(broker_url: str, **more: str) -> dict[str, str]:
    """What a process needs to work on the running test's database, files and broker."""
    return {
        **os.environ,
        "DJANGO_SETTINGS_MODULE": "config.settings",
        "DATABASE_URL": database_url(),
        "PADDOCK_DATA": str(settings.DATA_DIR),
        "CELERY_BROKER_URL": broker_url,
        "CACHE_URL": "redis://127.0.0.1:1/1",
        "PYTHONUNBUFFERED": "1",
        **more,
    }


@contextmanager
def celery_worker(app: str, env: dict[str, str], log: Path, ready: Path, name: str = "w") -> Iterator[subprocess.Popen]:
    """A Celery worker with one pool process, from when it makes the file ``ready`` on.

    At the end of the block its whole session is killed.
    """
    ready.unlink(missing_ok=True)
    command = [sys.executable, "-m", "celery", "--app", app, "worker", "--pool", "prefork", "--concurrency", "1"]
    command += ["--hostname", f"{name}@test", "--without-gossip", "--without-mingle"]
    with log.open("ab") as output:
        process = subprocess.Popen(
            command, cwd=CHECKOUT, env=env, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        wait_for(lambda: ready.exists() or process.poll() is not None, 60, log)
        assert process.poll() is None, log.read_text()
        yield process
    finally:
        kill_session(process.pid)
        process.wait()


def kill_session(leader: int) -> None:
    """SIGKILL every process of a session."""
    for pid in session_of(leader):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def session_of(leader: int) -> list[int]:
    """The living processes of the session that ``leader`` started."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            state, _, _, session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(session) == leader and state != "Z":
            found.append(int(entry.name))
    return found


def parent_of(pid: int) -> int:
    """The parent of a process. OSError when it is gone."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def family_of(ancestor: int) -> set[int]:
    """A process and all its descendants."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError):
                children.setdefault(parent_of(int(entry.name)), []).append(int(entry.name))
    found, new = set(), [ancestor]
    while new:
        pid = new.pop()
        found.add(pid)
        new += children.get(pid, [])
    return found


def is_running(pid: int) -> bool:
    """Whether a process lives (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def threads_of(pid: int) -> int:
    """How many threads a process has. OSError when it is gone."""
    return sum(1 for _ in Path(f"/proc/{pid}/task").iterdir())


@contextmanager
def suspended(pid: int) -> Iterator[None]:
    """A process does nothing within the block."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)


def wait_for(holds: Callable[[], object], limit_s: float = 30.0, log: Path | None = None) -> None:
    """Poll until ``holds()`` is true."""
    deadline = monotonic() + limit_s
    while not holds():
        if monotonic() > deadline:
            raise AssertionError("it never came true" + (f"\n{log.read_text()}" if log else ""))
        sleep(0.02)
