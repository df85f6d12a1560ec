"""A throwaway PostgreSQL server for the tests that are about locks."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp


def program(name: str) -> str | None:
    """Where a program of the server lies: on the path, or where Debian puts it."""
    found = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return shutil.which(name) or (str(found[-1]) if found else None)


@contextmanager
def postgres() -> Iterator[str]:
    """The DATABASE_URL of a fresh server that listens on a unix socket only and is gone afterwards with all its data.

    The server refuses to run as root, so root starts it as ``nobody``.
    """
    folder = Path(mkdtemp(prefix="paddock-pg-"))
    who = {"user": "nobody", "group": "nogroup"} if os.geteuid() == 0 else {}
    if who:
        shutil.chown(folder, **who)
    data, log = folder / "data", folder / "log"
    initdb, control = program("initdb"), program("pg_ctl")
    assert initdb and control, "ask program() first"
    run = {"check": True, "stdout": subprocess.DEVNULL, "cwd": folder, **who}
    options = f"-k {folder} -c listen_addresses= -c fsync=off -c max_connections=60"
    try:
        subprocess.run([initdb, "-D", data, "-U", "paddock", "-A", "trust", "-N", "-E", "UTF8"], **run)
        subprocess.run([control, "-D", data, "-l", log, "-w", "-o", options, "start"], **run)
        try:
            yield f"postgres://paddock@/postgres?host={folder}"
        finally:
            subprocess.run([control, "-D", data, "-w", "-m", "fast", "stop"], **run)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
