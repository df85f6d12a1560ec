"""Whether the pages of the database are whole: read each night, and told by readiness until they are found whole."""

from __future__ import annotations

import logging

from django.core.cache import cache
from django.db import connection

from .backup.databases import damage

logger = logging.getLogger(__name__)
_KEY = "damaged_pages"


def look_at_pages() -> str:
    """What is wrong with the pages of a SQLite database, in its words; ``""`` for nothing. Reads all of it.

    PostgreSQL has a server that looks after its own.
    """
    if connection.vendor != "sqlite":
        return ""
    connection.ensure_connection()
    problem = damage(connection.connection)
    cache.set(_KEY, problem, None)
    if problem:
        logger.error("The database is damaged: %s. Restore it from a backup: docs/operators.md.", problem)
    return problem


def are_whole() -> bool:
    """Whether the last look found nothing; before the first, too."""
    return not cache.get(_KEY, "")
