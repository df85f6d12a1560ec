"""The triggers that refuse to change or delete entries of the audit log.

They are installed after every ``migrate``: SQLite drops them when a migration rebuilds the table.
"""

from typing import Any

from django.db import connections, transaction

from .models import AuditEntry

TABLE = AuditEntry._meta.db_table
NAME = "core_audit_append_only"
MESSAGE = "the audit log is append-only"


def install(using: str) -> None:
    """Create the triggers where they are missing and the table exists."""
    connection = connections[using]
    with transaction.atomic(using=using), connection.cursor() as cursor:
        if TABLE in connection.introspection.table_names(cursor):
            for statement in _STATEMENTS[connection.vendor]:
                cursor.execute(statement)


def remove(using: str) -> None:
    """Drop the triggers, until the next ``migrate``: for tests that empty the database."""
    connection = connections[using]
    with connection.cursor() as cursor:
        for event in _EVENTS:
            on = f" ON {TABLE}" if connection.vendor == "postgresql" else ""
            cursor.execute(f"DROP TRIGGER IF EXISTS {NAME}_{event.lower()}{on}")


def installed_after_migrate(sender: Any, using: str, **kwargs: Any) -> None:
    """Receiver of ``post_migrate``."""
    install(using)


_EVENTS = ("UPDATE", "DELETE")
_SQLITE = [
    f"CREATE TRIGGER IF NOT EXISTS {NAME}_{event.lower()} BEFORE {event} ON {TABLE} "
    f"BEGIN SELECT RAISE(ABORT, '{MESSAGE}'); END"
    for event in _EVENTS
]
_POSTGRESQL = [
    f"CREATE OR REPLACE FUNCTION {NAME}() RETURNS trigger LANGUAGE plpgsql AS "
    f"$$ BEGIN RAISE EXCEPTION '{MESSAGE}' USING ERRCODE = 'integrity_constraint_violation'; END $$",
    *(
        f"CREATE OR REPLACE TRIGGER {NAME}_{event.lower()} BEFORE {event} ON {TABLE} "
        f"FOR EACH ROW EXECUTE FUNCTION {NAME}()"
        for event in _EVENTS
    ),
]
_STATEMENTS = {"sqlite": _SQLITE, "postgresql": _POSTGRESQL}
