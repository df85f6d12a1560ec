"""The triggers that keep :class:`races.models.BoardCount` in step with entries, however these are written.

They are installed after every ``migrate``: SQLite drops them when a migration rebuilds the table of entries. On
PostgreSQL a statement is counted once; it locks the row of the race's total first.
"""

from typing import Any

from django.db import connections, transaction

from ..models.counting import CLASSIFIED, EVERYBODY, LEVEL_BITS, SHIFTS, TOTAL, BoardCount
from ..ranks import MOST_DRIVEN, NOT_CLASSIFIED

VERSION = 3  # of the statements below: a change of theirs needs the next number
ENTRIES, COUNTS = "races_entry", BoardCount._meta.db_table
_RANKED = NOT_CLASSIFIED - MOST_DRIVEN
_NAME = f"races_board_v{VERSION}"
assert SHIFTS[-1] == 0 and SHIFTS[-2] == LEVEL_BITS


def install(using: str) -> bool:
    """Create the triggers and recompute the counts; False if they exist already or the tables do not."""
    connection = connections[using]
    with connection.cursor() as cursor:
        tables = set(connection.introspection.table_names(cursor))
        if not {ENTRIES, COUNTS} <= tables:
            return False
        statements, known = _DIALECTS[connection.vendor]
        cursor.execute(known)
        if cursor.fetchone()[0] == 3:
            return False
    with transaction.atomic(using=using), connection.cursor() as cursor:
        for statement in statements():
            cursor.execute(statement)
    rebuild(using=using)
    return True


def rebuild(*, using: str = "default") -> None:
    """Work out the counts of all races from their entries."""
    counted = f"SELECT race_id, rank_score, is_baseline FROM {ENTRIES} WHERE withdrawn_at IS NULL"
    sums = "COUNT(*), SUM(CASE WHEN is_baseline THEN 0 ELSE 1 END)"
    parts = [
        f"SELECT race_id, {shift}, rank_score >> {shift}, {sums} FROM ({counted}) AS e GROUP BY 1, 3"
        for shift in SHIFTS
    ]
    parts += [
        f"SELECT race_id, {TOTAL}, {bucket}, {sums} FROM ({counted}) AS e {condition} GROUP BY 1"
        for bucket, condition in ((EVERYBODY, ""), (CLASSIFIED, f"WHERE rank_score < {_RANKED}"))
    ]
    with transaction.atomic(using=using), connections[using].cursor() as cursor:
        cursor.execute(f"DELETE FROM {COUNTS}")
        for part in parts:
            cursor.execute(f"INSERT INTO {COUNTS} (race_id, shift, bucket, rows, racers) {part}")


def installed_after_migrate(sender: Any, using: str, **kwargs: Any) -> None:
    """Receiver of ``post_migrate``."""
    install(using)


# --- SQLite: row by row, in place ----------------------------------------------------------------------------------


def _sqlite() -> list[str]:
    changed = " OR ".join(
        f"OLD.{column} IS NOT NEW.{column}" for column in ("race_id", "rank_score", "is_baseline", "withdrawn_at")
    )
    statements = [f"DROP TRIGGER IF EXISTS {name}" for name in _old_names()]
    for event, when, body in (
        ("INSERT", "NEW.withdrawn_at IS NULL", _sqlite_step("NEW", 1)),
        ("DELETE", "OLD.withdrawn_at IS NULL", _sqlite_step("OLD", -1)),
        (
            "UPDATE OF race_id, rank_score, is_baseline, withdrawn_at",
            changed,
            _sqlite_step("OLD", -1) + _sqlite_step("NEW", 1),
        ),
    ):
        name = f"{_NAME}_{event.split()[0].lower()}"
        steps = " ".join(f"{step};" for step in body)
        statements.append(f"CREATE TRIGGER {name} AFTER {event} ON {ENTRIES} WHEN {when} BEGIN {steps} END")
    return statements


def _sqlite_step(row: str, delta: int) -> list[str]:
    keys = [(shift, f"{row}.rank_score >> {shift}", "") for shift in SHIFTS]
    keys += [(TOTAL, str(EVERYBODY), ""), (TOTAL, str(CLASSIFIED), f" AND {row}.rank_score < {_RANKED}")]
    racers = f"CASE WHEN {row}.is_baseline THEN 0 ELSE {delta} END"
    steps = []
    for shift, bucket, condition in keys:
        here = f"{row}.withdrawn_at IS NULL{condition}"
        if delta > 0:
            # two statements: an upsert would follow the conflict clause of the statement that fired the trigger
            steps.append(
                f"INSERT OR IGNORE INTO {COUNTS} (race_id, shift, bucket, rows, racers) "
                f"SELECT {row}.race_id, {shift}, {bucket}, 0, 0 WHERE {here}"
            )
        steps.append(
            f"UPDATE {COUNTS} SET rows = rows + {delta}, racers = racers + {racers} "
            f"WHERE race_id = {row}.race_id AND shift = {shift} AND bucket = {bucket} AND {here}"
        )
    return steps


def _old_names() -> list[str]:
    events = ("insert", "update", "delete")
    return [f"races_board_v{number}_{event}" for number in range(1, VERSION + 1) for event in events]


# --- PostgreSQL: statement by statement ----------------------------------------------------------------------------

_COLUMNS = "id, race_id, rank_score, is_baseline"
_PLUS = f"SELECT {_COLUMNS}, 1 AS delta FROM new_rows WHERE withdrawn_at IS NULL"
_MINUS = f"SELECT {_COLUMNS}, -1 AS delta FROM old_rows WHERE withdrawn_at IS NULL"


def _postgresql() -> list[str]:
    statements = []
    for event, source, tables in (
        ("INSERT", _PLUS, "NEW TABLE AS new_rows"),
        ("DELETE", _MINUS, "OLD TABLE AS old_rows"),
        ("UPDATE", f"{_PLUS} UNION ALL {_MINUS}", "OLD TABLE AS old_rows NEW TABLE AS new_rows"),
    ):
        name = f"{_NAME}_{event.lower()}"
        older = [old for old in _old_names() if old.endswith(event.lower())]
        statements += [f"DROP TRIGGER IF EXISTS {old} ON {ENTRIES}" for old in older]
        statements.append(
            f"CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
            f"{_postgresql_steps(event, source)} RETURN NULL; END $$"
        )
        statements.append(
            f"CREATE TRIGGER {name} AFTER {event} ON {ENTRIES} REFERENCING {tables} "
            f"FOR EACH STATEMENT EXECUTE FUNCTION {name}()"
        )
    return statements


def _postgresql_steps(event: str, source: str) -> str:
    moved = (
        f"SELECT race_id, rank_score, is_baseline, SUM(delta) AS delta FROM ({source}) AS all_rows "
        "GROUP BY race_id, rank_score, is_baseline HAVING SUM(delta) <> 0"
    )
    levels = ", ".join(f"({shift})" for shift in SHIFTS)
    each = "delta, CASE WHEN is_baseline THEN 0 ELSE delta END AS racer FROM moved"
    sums = (
        "SELECT race_id, shift, bucket, SUM(delta) AS delta, SUM(racer) AS racer FROM ("
        f"SELECT race_id, shift, rank_score >> shift AS bucket, {each}, (VALUES {levels}) AS levels (shift) "
        f"UNION ALL SELECT race_id, {TOTAL}, {EVERYBODY}, {each} "
        f"UNION ALL SELECT race_id, {TOTAL}, {CLASSIFIED}, {each} WHERE rank_score < {_RANKED}"
        ") AS keys GROUP BY race_id, shift, bucket HAVING SUM(delta) <> 0 OR SUM(racer) <> 0 "
        "ORDER BY race_id, shift DESC, bucket"
    )
    lock = (
        f"IF NOT EXISTS (WITH moved AS ({moved}) SELECT 1 FROM moved) THEN RETURN NULL; END IF; "
        f"PERFORM 1 FROM {COUNTS} WHERE shift = {TOTAL} AND bucket = {EVERYBODY} AND race_id IN "
        f"(WITH moved AS ({moved}) SELECT race_id FROM moved) ORDER BY race_id FOR UPDATE; "
    )
    if event == "DELETE":  # a race is deleted with its counts: nothing is written for it again
        return lock + (
            f"WITH moved AS ({moved}), sums AS ({sums}) "
            f"UPDATE {COUNTS} AS c SET rows = c.rows + s.delta, racers = c.racers + s.racer FROM sums AS s "
            "WHERE c.race_id = s.race_id AND c.shift = s.shift AND c.bucket = s.bucket;"
        )
    return lock + (
        f"WITH moved AS ({moved}), sums AS ({sums}) INSERT INTO {COUNTS} (race_id, shift, bucket, rows, racers) "
        "SELECT race_id, shift, bucket, delta, racer FROM sums ON CONFLICT (race_id, shift, bucket) DO UPDATE "
        f"SET rows = {COUNTS}.rows + EXCLUDED.rows, racers = {COUNTS}.racers + EXCLUDED.racers;"
    )


_DIALECTS = {
    "sqlite": (_sqlite, f"SELECT COUNT(*) FROM sqlite_master WHERE type = 'trigger' AND name LIKE '{_NAME}_%%'"),
    "postgresql": (
        _postgresql,
        f"SELECT COUNT(*) FROM pg_trigger WHERE tgname LIKE '{_NAME}_%%' AND tgrelid = '{ENTRIES}'::regclass",
    ),
}
