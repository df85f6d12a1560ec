"""A site's worth of racers and entries, made by the database itself: a million take a minute and not an evening.

The triggers that count a board are off meanwhile, and the counts are worked out once at the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Any

from django.db import connection, models

# Score in milliseconds of entry ``n``: 7919 is prime, so there is no order, and equal scores among many.
_SCORE = "(10000 + n * 7919 % 50000)"


def make_racers(count: int, now: datetime) -> None:
    """Racers ``r0`` to ``r{count - 1}``, who cannot log in, with ids that follow each other."""
    from accounts.models import Racer

    values = {"alias": "'r' || n", "email": "'r' || n || '@example.org'"}
    insert(Racer, values, {"password": "!", "joined_at": now}, f"({series(count)}) AS numbers")


def make_race(slug: str, track: Any, now: datetime) -> Any:
    """An open race that anybody may look at."""
    from races.models import Race, RaceKind

    return Race.objects.create(
        kind=RaceKind.COMMUNITY,
        slug=slug,
        name=slug,
        track=track,
        opens_at=now - timedelta(days=1),
        closes_at=now + timedelta(days=1),
    )


def fill(race: Any, count: int, now: datetime) -> None:
    """Entries of the first ``count`` racers, nine in ten of them classified, with many equal scores."""
    from accounts.models import Racer
    from races.models import Entry
    from races.ranks import LAST, NO_RESULT

    first = Racer.objects.filter(alias="r0").values_list("pk", flat=True).get()
    without_result = "n % 10 = 0"
    json = "CAST({} AS jsonb)" if connection.vendor == "postgresql" else "{}"
    third = f"({_SCORE} / 3)"
    sectors = f"'[' || {third} || ', ' || {third} || ', ' || ({_SCORE} - 2 * {third}) || ']'"

    def either(without: Any, with_one: str) -> str:
        return f"CASE WHEN {without_result} THEN {without} ELSE {with_one} END"

    timed = dict.fromkeys(("score_ms", "average_ms", "best_lap_ms", "own_lap_ms"), either("NULL", _SCORE))
    values = timed | {
        "racer": f"{first} + n",
        "classified": f"NOT ({without_result})",
        "rank_score": either(NO_RESULT, _SCORE),
        "rank_lap": either(LAST, _SCORE),
        "total_ms": either("NULL", f"3 * {_SCORE}"),
        "complete_laps": either(0, "3"),
        "last_number": either(0, "1"),
        "sectors": either(json.format("'[]'"), json.format(sectors)),
    }
    fixed = {"race": race.pk, "entered_at": now, "achieved_at": now}
    insert(Entry, values, fixed, f"({series(count)}) AS numbers")


@contextmanager
def counted_at_the_end() -> Iterator[None]:
    """No board is counted within; afterwards all are."""
    from races.boards.triggers import install, rebuild

    on_a_server = connection.vendor == "postgresql"
    with connection.cursor() as cursor:
        if on_a_server:
            cursor.execute("ALTER TABLE races_entry DISABLE TRIGGER USER")
        else:
            cursor.execute("SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'races_entry'")
            for (name,) in cursor.fetchall():
                cursor.execute(f"DROP TRIGGER {name}")
    yield
    with connection.cursor() as cursor:
        if on_a_server:
            cursor.execute("ALTER TABLE races_entry ENABLE TRIGGER USER")
            rebuild()
            cursor.execute("VACUUM ANALYZE")  # as a server does by itself in time
        else:
            install("default")


def series(count: int) -> str:
    """SQL for the rows 0 to ``count - 1`` of a column ``n``."""
    if connection.vendor == "postgresql":
        return f"SELECT n FROM generate_series(CAST(0 AS bigint), {count - 1}) AS series (n)"
    return (
        f"WITH RECURSIVE series (n) AS (SELECT 0 UNION ALL SELECT n + 1 FROM series WHERE n < {count - 1}) "
        "SELECT n FROM series"
    )


def insert(model: type[models.Model], values: Mapping[str, str], fixed: Mapping[str, Any], source: str) -> None:
    """A row of ``model`` for each row of ``source``: SQL by field, the same value everywhere, or the default."""
    columns, expressions, parameters = [], [], []
    for field in model._meta.concrete_fields:
        if isinstance(field, models.AutoField):
            continue
        columns.append(connection.ops.quote_name(field.column or ""))
        expressions.append(values[field.name].replace("%", "%%") if field.name in values else "%s")
        if field.name not in values:
            parameters.append(field.get_db_prep_save(fixed.get(field.name, field.get_default()), connection))
    table = connection.ops.quote_name(model._meta.db_table)
    with connection.cursor() as cursor:
        cursor.execute(
            f"INSERT INTO {table} ({', '.join(columns)}) SELECT {', '.join(expressions)} FROM {source} ORDER BY n",
            parameters,
        )
