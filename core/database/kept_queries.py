"""Queries that are compiled once a process: Django takes several times as long to compile one as SQLite to run it."""

import inspect
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from types import SimpleNamespace
from typing import Any, Generic, TypeVar

from django.db import DEFAULT_DB_ALIAS, connections
from django.db.models import QuerySet, Value
from django.db.models.sql.compiler import SQLCompiler

T = TypeVar("T")


@dataclass(frozen=True)
class _Place:
    """Of a value among the parameters of the SQL; ``before``: so much less than a time; ``index``: in a list."""

    name: str
    before: timedelta = timedelta(0)
    index: int | None = None


class _Parameter(Value):
    """Stands for a value. A time may be the one so long before, and a list has values by index."""

    def __sub__(self, other: Any) -> Any:
        return _Parameter(replace(self.value, before=self.value.before + other))

    def at(self, index: int) -> Any:
        return _Parameter(replace(self.value, index=index))


@dataclass(frozen=True)
class _Compiled:
    rows: Any
    compiler: SQLCompiler
    sql: str
    params: tuple[Any, ...]
    converters: dict[int, Any]


class KeptQuery(Generic[T]):
    """A query whose SQL is kept, and run with other values each time.

    ``build`` returns a queryset in which its parameters, expressions, stand for the values. Everything else in it must
    be the same each time. A value is passed by the parameter's name: a number, a text or a time. The query may do
    without a parameter that has a default."""

    def __init__(self, build: Callable[..., QuerySet[Any, T]]) -> None:
        self._build = build
        self._compiled: dict[str, _Compiled] = {}

    def __call__(self, **values: int | str | datetime | Sequence[str] | None) -> list[T]:
        connection = connections[DEFAULT_DB_ALIAS]
        kept = self._compiled.get(connection.vendor)
        if kept is None:
            kept = self._compiled[connection.vendor] = self._compile(connection)

        def bound(place: _Place) -> Any:
            value: Any = values[place.name]
            if place.index is not None:
                return value[place.index]
            if isinstance(value, datetime):
                return connection.ops.adapt_datetimefield_value(value - place.before)
            return value

        params = tuple(bound(each) if isinstance(each, _Place) else each for each in kept.params)
        compiler: Any = copy(kept.compiler)
        compiler.connection = connection  # of this thread
        compiler.as_sql = lambda: (kept.sql, params)
        compiler.get_converters = lambda expressions: kept.converters
        query = copy(kept.rows.query)
        query.get_compiler = lambda *args, **kwargs: compiler
        # what Django's iterables of rows ask of their queryset
        asked = SimpleNamespace(query=query, db=DEFAULT_DB_ALIAS, _fields=kept.rows._fields, _known_related_objects={})
        return list(kept.rows._iterable_class(asked))

    def _compile(self, connection: Any) -> _Compiled:
        names = inspect.signature(self._build).parameters
        rows = self._build(*(_Parameter(_Place(name)) for name in names))
        compiler = rows.query.get_compiler(connection=connection)
        sql, params = compiler.as_sql()
        needed = {name for name, parameter in names.items() if parameter.default is parameter.empty}
        assert {each.name for each in params if isinstance(each, _Place)} >= needed, sql
        sql, params = _with_literals(sql, params)
        converters = compiler.get_converters([column[0] for column in compiler.select[: compiler.col_count]])
        return _Compiled(rows, compiler, sql, params, converters)


def _with_literals(sql: str, params: Sequence[Any]) -> tuple[str, tuple[Any, ...]]:
    """The SQL with its constant texts and numbers in it. SQLite prepares a statement again at each run when a parameter
    of it is compared with what the condition of a partial index names (``exprCompareVariable`` in its expr.c)."""
    first, *parts = sql.split("%s")
    assert len(parts) == len(params), sql
    left = []
    for place, (part, value) in enumerate(zip(parts, params, strict=True)):
        if isinstance(value, str):
            text = str.__str__(value).replace("'", "''").replace("%", "%%")
            parts[place] = f"'{text}'{part}"
        elif type(value) is int:
            parts[place] = f"{value}{part}"
        else:
            parts[place] = f"%s{part}"
            left.append(value)
    return first + "".join(parts), tuple(left)
