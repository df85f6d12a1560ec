"""After a test that commits, the database is as it was migrated.

Django's own way deletes from every table and makes all permissions and content types anew, a tenth of a second of a
processor for each test. Here only tables with rows are emptied, and what migrating left in some is put back where a
test changed it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from django.db import connection, transaction
from django.test import TransactionTestCase

from core.audit import triggers
from core.audit.models import AuditEntry

OF_DJANGO = "django_migrations"
Rows = list[tuple]


class Migrated:
    """The state to come back to: the tables, and the rows of those that have some."""

    def __init__(self) -> None:
        tables = sorted(set(connection.introspection.django_table_names(only_existing=True)) - {OF_DJANGO})
        has_rows = "SELECT {} WHERE EXISTS (SELECT 1 FROM {})"
        self._which = " UNION ALL ".join(has_rows.format(f"'{table}'", _quoted(table)) for table in tables)
        self._rows = {table: _read(table) for table in self._with_rows()}

    def restore(self) -> None:
        """Empty what has rows that migrating did not leave there, and put back what it did."""
        if AuditEntry.objects.exists():
            with transaction.atomic():
                triggers.remove("default")
                AuditEntry.objects.all().delete()
                triggers.install("default")
        with transaction.atomic():  # keys are checked at its end, so that the order does not matter
            while changed := self._changed():  # again, where a trigger counted what went
                for table in changed:
                    _run(f"DELETE FROM {_quoted(table)}")
                    if table in self._rows:
                        _write(table, self._rows[table])

    def _changed(self) -> list[str]:
        has_rows = self._with_rows()
        return [
            *(table for table in has_rows if table not in self._rows),
            *(table for table, rows in self._rows.items() if _read(table) != rows),
        ]

    def _with_rows(self) -> list[str]:
        with connection.cursor() as cursor:
            cursor.execute(self._which)
            return [table for (table,) in cursor.fetchall()]


@contextmanager
def emptied() -> Iterator[None]:
    """For as long as this lasts, tests that commit leave the database as it is now."""
    migrated = Migrated()

    def teardown(_case: TransactionTestCase) -> None:
        migrated.restore()

    with patch.object(TransactionTestCase, "_fixture_teardown", teardown):
        yield


def _read(table: str) -> Rows:
    with connection.cursor() as cursor:
        cursor.execute(f"SELECT * FROM {_quoted(table)} ORDER BY 1")
        return cursor.fetchall()


def _write(table: str, rows: Rows) -> None:
    marks = ", ".join(["%s"] * len(rows[0]))
    with connection.cursor() as cursor:
        cursor.executemany(f"INSERT INTO {_quoted(table)} VALUES ({marks})", rows)


def _run(sql: str) -> None:
    with connection.cursor() as cursor:
        cursor.execute(sql)


def _quoted(name: str) -> str:
    return connection.ops.quote_name(name)
