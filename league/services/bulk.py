"""Writing very many rows of one table at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from django.db import connection, models, transaction

BATCH = 1000  # rows of up to 65 columns: PostgreSQL takes 65,535 values in a statement
# What the database's driver takes as it is. Others are prepared value by value.
_PLAIN = (models.IntegerField, models.BooleanField, models.CharField, models.FloatField, models.ForeignKey)


def insert_rows(model: type[models.Model], columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> int:
    """Insert ``rows``, the values of the fields ``columns`` (foreign keys: the id); all other fields get their default.

    All or none, and several times as fast as ``bulk_create``, which makes an object of every row. Returns how many.
    Raises IntegrityError.
    """
    named: Mapping[str, models.Field] = {field.name: field for field in model._meta.concrete_fields}
    rest = [field for name, field in named.items() if name not in columns and not isinstance(field, models.AutoField)]
    fields = [named[name] for name in columns] + rest
    defaults = tuple(_prepared(field)(field.get_default()) for field in rest)
    prepare = [None if isinstance(named[name], _PLAIN) else _prepared(named[name]) for name in columns]
    values = (
        (*(value if ready is None else ready(value) for value, ready in zip(row, prepare, strict=True)), *defaults)
        for row in rows
    )
    quote = connection.ops.quote_name
    into_columns = ", ".join(quote(field.column or "") for field in fields)
    into = f"INSERT INTO {quote(model._meta.db_table)} ({into_columns}) VALUES "
    one = f"({', '.join(['%s'] * len(fields))})"
    count = 0
    with transaction.atomic(), connection.cursor() as cursor:
        while batch := list(islice(values, BATCH)):
            count += len(batch)
            if connection.vendor == "sqlite":
                cursor.executemany(into + one, batch)
            else:  # a server counts and answers statements, so there are few of them
                cursor.execute(into + ", ".join([one] * len(batch)), [value for row in batch for value in row])
    return count


def _prepared(field: models.Field) -> Callable[[Any], Any]:
    return lambda value: field.get_db_prep_save(value, connection)
