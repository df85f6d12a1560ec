"""A site from before 0.1.0 that lived on PostgreSQL is carried over there: every row, every page, and ids go on.

The sites that are kept are of SQLite. Their old tables are made anew on a PostgreSQL server, with the types that Django
gave them there, and filled with the same rows.
"""

from __future__ import annotations

import json
import re
import sqlite3
import tarfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg
import pytest

from config.carry_over import MADE_ANEW, TABLES
from tests.postgres import MIGRATED, is_installed, migrated, postgres
from tests.upgrade.test_upgrade import HERE, SITES, differences, run

pytestmark = [pytest.mark.soak, pytest.mark.postgres]  # on SQLite: test_upgrade.py

# SQLite's declared type: Django's on PostgreSQL, and what a value is there
TYPES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "bool": ("boolean", bool),
    "datetime": ("timestamp with time zone", lambda text: f"{text}+00"),
    "date": ("date", str),
    "real": ("double precision", float),
    "blob": ("bytea", bytes),
    "char(32)": ("uuid", str),
    "text": ("text", str),
    "integer": ("integer", int),
    "integer unsigned": ("integer", int),
    "decimal": ("numeric(4, 1)", str),
    "smallint": ("smallint", int),
    "smallint unsigned": ("smallint", int),
    "bigint": ("bigint", int),
    "bigint unsigned": ("bigint", int),
}


def kind_of(declared: str, column: str, made: str) -> tuple[str, Callable[[Any], Any]]:
    """The type of a column that the statement ``made`` declares."""
    if declared == "text" and re.search(rf'JSON_VALID\("{column}"\)', made):
        return "jsonb", str
    return (declared, str) if declared.startswith("varchar") else TYPES[declared]


def fill(database: psycopg.Connection, old: sqlite3.Connection) -> dict[str, int]:
    """Make the old tables in an empty database. How many rows each has."""
    counts = {}
    made = "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
    for table, statement in old.execute(made).fetchall():
        columns = [(row[1], row[2].lower()) for row in old.execute(f'PRAGMA table_info("{table}")')]
        kinds = [kind_of(declared, name, statement) for name, declared in columns]
        typed = ", ".join(f'"{name}" {kind}' for (name, _), (kind, _) in zip(columns, kinds, strict=True))
        database.execute(f'CREATE TABLE "{table}" ({typed})')
        rows = [
            [value if value is None else make(value) for value, (_, make) in zip(row, kinds, strict=True)]
            for row in old.execute(f'SELECT * FROM "{table}"')
        ]
        with database.cursor() as cursor:
            cursor.executemany(f'INSERT INTO "{table}" VALUES ({", ".join(["%s"] * len(columns))})', rows)
        counts[table] = len(rows)
    return counts


def next_ids(database: psycopg.Connection) -> dict[str, tuple[int, int]]:
    """By table: the greatest id, and the one that the next row gets."""
    tables = "SELECT table_name FROM information_schema.columns WHERE column_name = 'id' AND is_identity = 'YES'"
    found = {}
    for (table,) in database.execute(tables).fetchall():
        greatest = database.execute(f'SELECT coalesce(max(id), 0) FROM "{table}"').fetchone()
        following = database.execute(f"SELECT nextval(pg_get_serial_sequence('\"{table}\"', 'id'))").fetchone()
        assert greatest is not None and following is not None
        found[table] = (greatest[0], following[0])
    return found


@pytest.mark.skipif(not is_installed(), reason="no PostgreSQL server is installed")
def test_a_site_on_postgresql_is_carried_over(tmp_path: Path, postgresql: Path, monkeypatch: pytest.MonkeyPatch):
    site, data = SITES[-1], tmp_path / "data"
    data.mkdir(mode=0o700)
    with tarfile.open(HERE / f"{site}.tar.xz") as archive:
        archive.extractall(data, filter="data")
    (data / "paddock.sqlite3").rename(tmp_path / "before.sqlite3")
    with postgres(migrated(postgresql), MIGRATED) as url:
        old_url = f"{url.removesuffix(MIGRATED)}before"
        with psycopg.connect(url, autocommit=True) as database:
            database.execute("CREATE DATABASE before")
        with closing(sqlite3.connect(tmp_path / "before.sqlite3")) as old, psycopg.connect(old_url) as database:
            was = fill(database, old)
            mails = old.execute("SELECT count(*) FROM league_notice WHERE mail_state <> ''").fetchone()[0]
        monkeypatch.setenv("DATABASE_URL", url)
        assert "Carried over" in run(data, "manage.py", "carry_over", old_url)

        with psycopg.connect(url, autocommit=True) as database:
            renamed = {old: new for new, old in TABLES.items() if new != "league_mail"}
            for table in was.keys() - MADE_ANEW - {"league_announcement"}:
                now = database.execute(f'SELECT count(*) FROM "{renamed.get(table, table)}"').fetchone()
                assert now == (was[table],), table
            assert database.execute("SELECT count(*) FROM league_mail").fetchone() == (mails,)
            following = next_ids(database)
            counted = following.pop("races_boardcount")  # triggers write it, and their tries take ids
            assert counted[1] > counted[0] > 0
            assert {table: ids for table, ids in following.items() if ids[1] != ids[0] + 1} == {}
            assert following["accounts_racer"][0] >= 2
        record = HERE / f"{site}.json"
        told = json.loads(run(data, "-m", "tests.upgrade.told", str(record)))
        assert differences(json.loads(record.read_text()), told) == []
