"""A test database that was migrated before is copied instead of migrated again.

Migrating takes half a second of a processor, in every worker and for every site that a test starts. A copy is kept in
pytest's cache under the name of what made it: the text of our migrations, models and triggers, and the versions of
Django and SQLite. ``migrate`` runs on it all the same, and finds nothing to do.
"""

from __future__ import annotations

import hashlib
import sqlite3
from contextlib import closing
from pathlib import Path
from tempfile import NamedTemporaryFile

import django
from django.db import connection
from django.db.backends.sqlite3._functions import register
from django.db.models import Model

from tests.shared import CHECKOUT

MADE_BY = (
    *("*/migrations/*.py", "*/models.py", "*/models/*.py", "*/apps.py", "*/*_triggers.py", "*/*/triggers.py"),
    "core/management/commands/migrate.py",
)


def template(folder: Path) -> Path:
    """Where the migrated database of this code is kept in ``folder``, whether it is there yet or not."""
    return folder / f"{digest(sqlite3.sqlite_version)}.sqlite3"


def digest(version: str) -> str:
    """A name for what our migrations make of an empty database of this ``version``."""
    made_by = hashlib.sha256(f"{django.__version__} {version}".encode())
    for source in sorted({path for pattern in MADE_BY for path in CHECKOUT.glob(pattern)}):
        made_by.update(source.relative_to(CHECKOUT).as_posix().encode() + b"\0" + source.read_bytes())
    return made_by.hexdigest()[:24]


def copy(source: Path, target: Path) -> None:
    """Copy a SQLite database that may be in use; whoever looks sees all of it or nothing."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with NamedTemporaryFile(dir=target.parent, prefix=".", suffix=".part", delete=False) as part:
        unfinished = Path(part.name)
    try:
        with closing(sqlite3.connect(source)) as read, closing(sqlite3.connect(unfinished)) as write:
            read.backup(write)
        unfinished.replace(target)
    finally:
        unfinished.unlink(missing_ok=True)


def insert(target: Path, row: Model) -> None:
    """Put a row, as it is, into a SQLite database that is not the tests' own."""
    fields = [field for field in row._meta.local_concrete_fields if not (field.generated or field is row._meta.pk)]
    values = [field.get_db_prep_save(field.pre_save(row, add=True), connection) for field in fields]
    names, marks = ", ".join(f'"{field.column}"' for field in fields), ", ".join("?" * len(fields))
    with closing(sqlite3.connect(target)) as database:
        register(database)  # constraints call functions of Django's
        database.execute(f"INSERT INTO {row._meta.db_table} ({names}) VALUES ({marks})", values)
        database.commit()


def keep(source: Path, target: Path) -> None:
    """Keep a database that has just been migrated as the only template of its folder."""
    copy(source, target)
    for older in target.parent.glob("*.sqlite3"):
        if older != target:
            older.unlink(missing_ok=True)
