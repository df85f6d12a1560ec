"""PostgreSQL for tests: throwaway servers, and tests that run once more on one."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from urllib.parse import quote

from tests import database
from tests.shared import CHECKOUT

OPTIONS = {
    **{"listen_addresses": "", "max_connections": "60"},
    **{"fsync": "off", "full_page_writes": "off", "synchronous_commit": "off"},  # no test is about a power failure
    "jit": "off",  # compiling a query of a test costs more than running it
}
MIGRATED = "test_postgres"  # the name that pytest-django gives the test database of the database ``postgres``


def program(name: str) -> str | None:
    """Where a program of the server lies: on the path, or where Debian puts it."""
    found = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return shutil.which(name) or (str(found[-1]) if found else None)


def is_installed() -> bool:
    """Whether tests can start a server."""
    return all(program(name) for name in ("initdb", "pg_ctl", "psql"))


@contextmanager
def postgres(copy_of: Path | None = None, name: str = "postgres") -> Iterator[str]:
    """The DATABASE_URL (of the database ``name``) of a server that listens on a unix socket only and is gone afterwards
    with all its data.

    Its data are fresh, or a copy of those of a server that has stopped (:func:`migrated`). The server refuses to run as
    root, so root starts it as ``nobody``.
    """
    folder = _folder()
    try:
        if copy_of is None:
            _make(folder / "data")
        else:
            subprocess.run(["cp", "-a", copy_of, folder / "data"], check=True)
        with _served(folder / "data", folder):
            yield _url(folder, name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def migrated(kept: Path) -> Path:
    """The data of a stopped server with a migrated test database, made once for each state of the code.

    ``kept``: the folder in which they are. Making them takes seconds of a processor, copying them none.
    """
    name = database.digest(subprocess.check_output([program("initdb"), "--version"], text=True))
    data = kept / name
    with (kept / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # two workers would both make it
        if not data.exists():
            for older in kept.glob("*/"):
                shutil.rmtree(older, ignore_errors=True)
            _migrate(data)
    return data


def again(kept: Path, *arguments: str) -> None:
    """Run tests (arguments of pytest) once more, on a PostgreSQL server of their own; fails with what they say."""
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--reuse-db"]
    # the other run makes, and deletes, a data folder of its own
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "PYTEST_"))}
    with postgres(migrated(kept)) as url:
        run = subprocess.run(
            [*command, "-m", "not postgres and not soak", *arguments],
            cwd=CHECKOUT,
            env=clean | {"DATABASE_URL": url},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    assert run.returncode == 0, run.stdout[-8000:]
    assert " passed" in run.stdout


def _migrate(data: Path) -> None:
    folder = _folder()
    try:
        _make(folder / "data")
        with _served(folder / "data", folder):
            create = [program("psql"), "-h", folder, "-U", "paddock", "-c", f"CREATE DATABASE {MIGRATED}", "postgres"]
            subprocess.run(create, check=True, stdout=subprocess.DEVNULL)
            subprocess.run(
                [sys.executable, "manage.py", "migrate", "--run-syncdb", "--verbosity", "0"],
                cwd=CHECKOUT,
                env=os.environ | {"DATABASE_URL": _url(folder, MIGRATED), "DJANGO_SETTINGS_MODULE": "tests.settings"},
                check=True,
            )
        shutil.move(folder / "data", data)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _folder() -> Path:
    folder = Path(mkdtemp(prefix="paddock-pg-"))
    if os.geteuid() == 0:
        shutil.chown(folder, **_who())
    return folder


def _who() -> dict[str, str]:
    return {"user": "nobody", "group": "nogroup"} if os.geteuid() == 0 else {}


def _url(folder: Path, name: str) -> str:
    return f"postgres://paddock@{quote(str(folder), safe='')}/{name}"


def _make(data: Path) -> None:
    command = [program("initdb"), "-D", data, "-U", "paddock", "-A", "trust", "-N", "-E", "UTF8", "--wal-segsize=1"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=data.parent, **_who())


@contextmanager
def _served(data: Path, sockets: Path) -> Iterator[None]:
    options = " ".join(f"-c {name}={value}" for name, value in OPTIONS.items())
    control = [program("pg_ctl"), "-D", data, "-w"]
    run = {"check": True, "stdout": subprocess.DEVNULL, "cwd": sockets, **_who()}
    subprocess.run([*control, "-l", sockets / "log", "-o", f"-k {sockets} {options}", "start"], **run)
    try:
        yield
    finally:
        subprocess.run([*control, "-m", "fast", "stop"], **run)
