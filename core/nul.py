"""The one letter that PostgreSQL keeps in no text: NUL. Nothing there is called so; SQLite just does not find it."""

from __future__ import annotations

from django.db import DataError


def is_of_nul(error: BaseException) -> bool:
    """Whether a query failed because somebody asked for a name with a NUL in it, which only PostgreSQL does."""
    return isinstance(error, DataError) and "NUL" in str(error)
