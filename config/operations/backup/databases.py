"""A consistent copy of a database in use, by SQLite's online backup or PostgreSQL's own tools."""

import os
import re
import shutil
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from django.db import connection, transaction

from paddock.errors import PlatformFault, UserFault

from . import files

_DEBIAN = Path("/usr/lib/postgresql")
_ENVIRONMENT = {  # what libpq reads, by Django's name for it: a password does not belong on a command line
    **{"dbname": "PGDATABASE", "user": "PGUSER", "password": "PGPASSWORD", "host": "PGHOST", "port": "PGPORT"},
    **{"sslmode": "PGSSLMODE", "sslrootcert": "PGSSLROOTCERT", "sslcert": "PGSSLCERT", "sslkey": "PGSSLKEY"},
    **{"options": "PGOPTIONS", "service": "PGSERVICE", "passfile": "PGPASSFILE", "hostaddr": "PGHOSTADDR"},
}


@dataclass(frozen=True)
class Snapshot:
    """The database as it was at one moment: in ``path``, and the names of the stored files that it refers to."""

    path: Path
    files: set[str]


@contextmanager
def snapshot(folder: Path) -> Iterator[Snapshot]:
    """The database of this moment, in a file in ``folder``. Raises UserFault ``postgres_tools_missing`` and
    PlatformFault ``database_damaged``, ``database_tool_failed``."""
    path = folder / "database"
    path.unlink(missing_ok=True)
    try:
        names = _sqlite_into(path) if connection.vendor == "sqlite" else _postgres_into(path)
    except sqlite3.OperationalError as error:  # locked for too long, no room
        raise PlatformFault("database_tool_failed", tool="SQLite", problem=str(error)) from error
    except sqlite3.DatabaseError as error:
        raise PlatformFault("database_damaged", problem=str(error)) from error
    try:
        yield Snapshot(path, names)
    finally:
        path.unlink(missing_ok=True)


def restore_from(path: Path) -> None:
    """Restore :func:`snapshot`'s file into the site's empty database, all or nothing. Raises UserFault
    ``postgres_tools_missing`` and PlatformFault ``database_damaged``, ``database_tool_failed``."""
    if connection.vendor == "sqlite":
        _sqlite_from(path)
    else:
        _postgres_from(path)


def is_empty() -> bool:
    return not connection.introspection.table_names()


def damage(database: sqlite3.Connection) -> str:
    """The damage of a SQLite database's pages in SQLite's words; ``""`` for none. Reads all of them. Constraints are
    left out: they call functions of Django's."""
    try:
        database.execute("PRAGMA ignore_check_constraints=ON")
        found = [row[0] for row in database.execute("PRAGMA quick_check(3)")]
    except sqlite3.DatabaseError as error:
        return str(error)
    finally:
        with suppress(sqlite3.DatabaseError):
            database.execute("PRAGMA ignore_check_constraints=OFF")
    return "" if found == ["ok"] else "; ".join(" ".join(line.split()) for line in found)


def _sqlite_path() -> Path:
    return Path(connection.settings_dict["NAME"])


def _sqlite_into(path: Path) -> set[str]:
    source = f"{_sqlite_path().absolute().as_uri()}?mode=rw"  # rw: the log of a database at rest is read, too
    with closing(sqlite3.connect(source, uri=True, timeout=20)) as read, closing(sqlite3.connect(path)) as write:
        read.backup(write)  # in one step: in many, each write of somebody else's would begin it anew
        write.execute("PRAGMA journal_mode=DELETE")
        if problem := damage(write):
            raise PlatformFault("database_damaged", problem=problem)
        return files.referred_to(write.execute)


def _sqlite_from(path: Path) -> None:
    with closing(sqlite3.connect(path)) as database:
        if problem := damage(database):
            raise PlatformFault("database_damaged", problem=problem)
    target = _sqlite_path()
    connection.close()
    descriptor = os.open(path, os.O_RDONLY)
    os.fsync(descriptor)
    os.close(descriptor)
    for beside in ("-wal", "-shm", "-journal"):  # of the empty one
        with suppress(FileNotFoundError):
            target.with_name(target.name + beside).unlink()
    path.chmod(0o600)
    path.replace(target)


def _postgres_into(path: Path) -> set[str]:
    tool = _tool("pg_dump")
    with transaction.atomic(durable=True), connection.cursor() as cursor:

        def ask(statement: str) -> list[tuple[Any, ...]]:
            cursor.execute(statement)
            return cursor.fetchall()

        cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
        ((moment,),) = ask("SELECT pg_export_snapshot()")
        options = ("--format=custom", "--no-owner", "--no-privileges", "--lock-wait-timeout=60s")
        _run(tool, *options, f"--snapshot={moment}", f"--file={path}")
        return files.referred_to(ask)


def _postgres_from(path: Path) -> None:
    tool = _tool("pg_restore")
    name = str(connection.settings_dict["NAME"]).replace("\\", "\\\\").replace("'", "\\'")
    connection.close()
    options = ("--single-transaction", "--exit-on-error", "--no-owner", "--no-privileges")
    _run(tool, *options, f"--dbname=dbname='{name}'", str(path))


def _tool(name: str) -> str:
    """A program of PostgreSQL's that is no older than the server: an older one refuses to work with it."""
    connection.ensure_connection()
    wanted = connection.pg_version // 10_000  # type: ignore[attr-defined]  # PostgreSQL's own
    found = [shutil.which(name), *sorted(map(str, _DEBIAN.glob(f"*/bin/{name}")))]
    for program in filter(None, found):
        with suppress(OSError, subprocess.SubprocessError):
            done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=10, check=True)
            version = re.search(r"\b(\d+)(?:\.|beta|rc|devel|$|\s)", done.stdout)
            if version and int(version[1]) >= wanted:
                return program
    raise UserFault("postgres_tools_missing", tool=name, version=wanted)


def _run(*command: str) -> None:
    environment = {**os.environ, "LC_ALL": "C"}
    for name, value in connection.get_connection_params().items():
        if name in _ENVIRONMENT and value not in (None, ""):
            environment[_ENVIRONMENT[name]] = str(value)
    try:
        done = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    except OSError as error:
        raise PlatformFault("database_tool_failed", tool=Path(command[0]).name, problem=str(error)) from error
    if done.returncode != 0:
        problem = " ".join(done.stderr.split())[-300:].rstrip(".") or f"exit status {done.returncode}"
        raise PlatformFault("database_tool_failed", tool=Path(command[0]).name, problem=problem)


def applied_migrations() -> list[str]:
    """The names of the migrations that the database has, as ``room.number_name``. Raises DatabaseError."""
    with connection.cursor() as cursor:
        cursor.execute("SELECT app, name FROM django_migrations ORDER BY app, name")
        return [f"{room}.{name}" for room, name in cursor.fetchall()]
