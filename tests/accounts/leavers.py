"""A look for names in the whole database."""

from __future__ import annotations

import re

from django.db import connection


def tables_with(*texts: str) -> list[str]:
    """The tables whose rows contain one of the texts as a word, in any letter case, with the columns."""
    words = re.compile("|".join(rf"(?<![a-z0-9]){re.escape(text)}(?![a-z0-9])" for text in texts), re.IGNORECASE)
    found = []
    with connection.cursor() as cursor:
        for table in connection.introspection.table_names(cursor):
            cursor.execute(f'SELECT * FROM "{table}"')
            names = [column[0] for column in cursor.description]
            for row in cursor.fetchall():
                for name, value in zip(names, row, strict=True):
                    if words.search(str(value)):
                        found.append(f"{table}.{name}: {value}")
    return found
