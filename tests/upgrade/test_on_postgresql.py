"""A released version's site that runs on PostgreSQL is upgraded: every row, every page, and ids continue.

The recorded sites are of SQLite. The released migrations make their tables on a PostgreSQL server, and the rows are
copied into them.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg
import pytest

from tests.postgres import is_installed, postgres
from tests.upgrade.test_upgrade import SITES, assert_same_answers, run, unpacked

pytestmark = [pytest.mark.soak, pytest.mark.postgres]  # on SQLite: test_upgrade.py

# PostgreSQL's type: what a value of SQLite is there
VALUES: dict[str, Callable[[Any], Any]] = {
    "boolean": bool,
    "timestamp with time zone": lambda text: f"{text}+00",
    "bytea": bytes,
    "numeric": str,
}
MIGRATE = """
import json, os, sys, django
os.environ["DJANGO_SETTINGS_MODULE"] = "config.settings"
django.setup()
from django.db import connection
from django.db.migrations.executor import MigrationExecutor
MigrationExecutor(connection).migrate([tuple(one) for one in json.loads(sys.argv[1])])
"""
# written by migrations, or by triggers from the rows of other tables
DERIVED = {"django_migrations", "django_content_type", "auth_permission", "races_boardcount"}
LAST = "SELECT app, max(name) FROM django_migrations GROUP BY app"
COLUMNS = "SELECT column_name, data_type FROM information_schema.columns WHERE table_name = %s ORDER BY 1"
IDS = "SELECT table_name FROM information_schema.columns WHERE column_name = 'id' AND is_identity = 'YES'"


def copy_rows(old: sqlite3.Connection, new: psycopg.Connection) -> dict[str, int]:
    """Copy all rows into tables of the same names. Returns how many each table has."""
    counts = {}
    new.execute("SET session_replication_role = replica")  # neither foreign keys nor triggers
    names = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
    for (table,) in old.execute(names).fetchall():
        columns = new.execute(COLUMNS, [table]).fetchall()
        assert {row[1] for row in old.execute(f'PRAGMA table_info("{table}")')} == {name for name, _ in columns}, table
        listed = ", ".join(f'"{name}"' for name, _ in columns)
        rows = [
            [value if value is None else VALUES.get(kind, lambda same: same)(value) for value, (_, kind) in pairs]
            for row in old.execute(f'SELECT {listed} FROM "{table}"')
            for pairs in [list(zip(row, columns, strict=True))]
        ]
        new.execute(f'DELETE FROM "{table}"')
        with new.cursor() as cursor:
            cursor.executemany(f'INSERT INTO "{table}" ({listed}) VALUES ({", ".join(["%s"] * len(columns))})', rows)
        counts[table] = len(rows)
    for (table,) in new.execute(IDS).fetchall():
        new.execute(
            f"SELECT setval(pg_get_serial_sequence('\"{table}\"', 'id'), greatest(max(id), 1)) FROM \"{table}\""
        )
    return counts


@pytest.mark.skipif(not is_installed(), reason="no PostgreSQL server is installed")
@pytest.mark.parametrize("site", SITES)
def test_a_site_on_postgresql_is_upgraded(site: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = unpacked(site, tmp_path)
    with postgres() as url:
        monkeypatch.setenv("DATABASE_URL", url)
        with closing(sqlite3.connect(data / "paddock.sqlite3")) as old:
            run(data, "-c", MIGRATE, json.dumps(old.execute(LAST).fetchall()))
            with psycopg.connect(url) as database:
                was = copy_rows(old, database)
        run(data, "manage.py", "migrate", "--no-input")
        with psycopg.connect(url) as database:
            for table in was.keys() - DERIVED:
                assert database.execute(f'SELECT count(*) FROM "{table}"').fetchone() == (was[table],), table
        assert_same_answers(site, data)
