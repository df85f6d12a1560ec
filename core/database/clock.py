"""The database's time, which all leases use: clocks of machines may differ by hours."""

from datetime import UTC, datetime

from django.db import connection


def database_now() -> datetime:
    """What time it is for the database, to the millisecond at least, aware and in UTC. One query."""
    with connection.cursor() as cursor:
        if connection.vendor == "postgresql":
            cursor.execute("SELECT STATEMENT_TIMESTAMP()")
            return cursor.fetchone()[0].astimezone(UTC)
        cursor.execute("SELECT STRFTIME('%Y-%m-%dT%H:%M:%f', 'now')")
        return datetime.fromisoformat(cursor.fetchone()[0]).replace(tzinfo=UTC)
