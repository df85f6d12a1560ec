"""Carrying the rows of a site from before 0.1.0 over into a new, empty database.

Until then rooms were cut otherwise and each had a dozen migrations; 0.1.0 has one initial migration a room. Rows are
copied table by table, by the names of their columns; stored files stay where they are, for the rows name them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import dj_database_url
from django.apps import apps
from django.contrib.auth.models import Permission
from django.contrib.contenttypes.models import ContentType
from django.core.management.color import no_style
from django.db import DEFAULT_DB_ALIAS, DatabaseError, connections, models, transaction
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.utils import load_backend

from paddock.errors import UserFault
from paddock.geometry.character import character_of
from paddock.geometry.npy import read_npy

# The last migrations before 0.1.0, by room
LAST = {
    "accounts": "0003_token_grants",
    "evaluation": "0013_turns",
    "league": "0015_hosts_of_webhooks",
    "races": "0013_pauses_of_videos",
    "tracks": "0003_looks",
    "training": "0007_turns_and_tolls",
}


def _character(npy: bytes, measure: str) -> int | None:
    """A track's corners or difficulty, which older versions did not reckon; None where its shape is not known."""
    return getattr(character_of(read_npy(bytes(npy), "")), measure) if npy else None


# New table: old one
TABLES = {
    "accounts_racer": "league_racer",
    "accounts_racer_groups": "league_racer_groups",
    "accounts_racer_user_permissions": "league_racer_user_permissions",
    "videos_video": "races_video",
    "core_outage": "evaluation_outage",
    "races_duelcompetitor": "races_duelcar",
    "league_mail": "league_notice",
}
# (new table, new column): old column
COLUMNS: dict[tuple[str, str], str] = {
    ("evaluation_result", "layout"): "course",
    ("evaluation_result", "trajectory"): "line",
    ("evaluation_rivalresult", "trajectory"): "line",
    ("league_webhookdelivery", "attempt"): "tries",
}
# (new table, new column): the old columns that it is made of, and how
MADE: dict[tuple[str, str], tuple[tuple[str, ...], Callable[..., Any]]] = {
    ("races_race", "rules"): (
        ("bot_lane_changes",),
        lambda changes: json.dumps({"bot_lane_changes": bool(changes)}),
    ),
    ("tracks_track", "corners"): (("npy",), lambda npy: _character(npy, "corners")),
    ("tracks_track", "difficulty"): (("npy",), lambda npy: _character(npy, "difficulty")),
    # a notice that never goes by mail has no row
    ("league_mail", "notice_id"): (("id",), lambda notice: notice),
    ("league_mail", "attempt"): (("mail_tries",), lambda tries: tries),
    ("league_mail", "state"): (("mail_state",), lambda state: state or None),
    ("league_mail", "ended_at"): (("mail_state", "at"), lambda state, at: at if state in ("sent", "failed") else None),
    ("league_webhookdelivery", "not_before"): (
        ("state", "next_at"),
        lambda state, next_at: next_at if state == "due" else None,
    ),
    ("league_webhookdelivery", "ended_at"): (
        ("state", "next_at"),
        lambda state, next_at: None if state == "due" else next_at,
    ),
}
# (old table, old column) that nothing is made of
DROPPED: set[tuple[str, str]] = {
    # what was told to everybody: events and the notices themselves say so
    *(("league_announcement", name) for name in ("id", "about", "at")),
}
# (app, model) of a content type: as it was
MODELS = {
    ("accounts", "racer"): ("league", "racer"),
    ("core", "outage"): ("evaluation", "outage"),
    ("races", "duelcompetitor"): ("races", "duelcar"),
    ("videos", "video"): ("races", "video"),
}
# Made by the migrations themselves, or by triggers from the rows of other tables
MADE_ANEW = {"django_content_type", "auth_permission", "races_boardcount", "django_migrations"}
_MARK = "league_racer"  # a table that only a database from before has
_ROWS = 500


def is_from_before(connection: BaseDatabaseWrapper) -> bool:
    """Whether a database is one of a version before 0.1.0."""
    return _MARK in connection.introspection.table_names()


def refuse_what_is_from_before(using: str = DEFAULT_DB_ALIAS, **kwargs: Any) -> None:
    """Before ``migrate``. Raises UserFault("site_from_before"): the new migrations would take the old for their own."""
    if is_from_before(connections[using]):
        raise UserFault("site_from_before")


def look_at(source: str) -> None:
    """Refuse what :func:`carry_over` would refuse of the old database, before a new one is made."""
    with _opened(source, connections[DEFAULT_DB_ALIAS].vendor) as old:
        _check(source, old)


def carry_over(source: str, *, tell: Callable[[str], None] = lambda line: None) -> dict[str, int]:
    """Copy all rows of ``source``, the path of a SQLite file or a database's URL, into the site's own database.

    Returns how many rows each table has got. The site's database must be migrated and hold no racer yet; it gets all or
    nothing. Raises UserFault("carry_unreadable"), ("carry_other_kind"), ("carry_other_state") for what cannot be
    copied, ("carry_not_empty") for a database that has racers.
    """
    new = connections[DEFAULT_DB_ALIAS]
    with _opened(source, new.vendor) as old:
        _check(source, old)
        tables = _tables()
        if any(model._meta.db_table == "accounts_racer" and model._default_manager.exists() for model in tables):
            raise UserFault("carry_not_empty")
        lost = _untold(old, tables)
        if lost:
            raise UserFault("carry_other_state", path=source, found=", ".join(lost[:5]))
        rows: dict[str, int] = {}
        with new.constraint_checks_disabled(), transaction.atomic():
            for model in tables:
                rows[model._meta.db_table] = _copy(old, new, model)
                tell(f"{model._meta.db_table}: {rows[model._meta.db_table]}")
            new.check_constraints()
            with new.cursor() as cursor:
                for statement in new.ops.sequence_reset_sql(no_style(), tables):
                    cursor.execute(statement)
    return rows


@contextmanager
def _opened(source: str, vendor: str) -> Iterator[BaseDatabaseWrapper]:
    """The old database under a name of its own, for reading."""
    if "://" in source:
        try:
            settings = dj_database_url.parse(source)
        except (ValueError, KeyError) as error:
            raise UserFault("carry_unreadable", path=source, problem=str(error)) from error
    elif Path(source).is_file():
        settings = dj_database_url.parse(f"sqlite:///{Path(source).resolve()}")
    else:
        raise UserFault("carry_unreadable", path=source, problem="no such file")
    settings = connections.configure_settings({DEFAULT_DB_ALIAS: settings})[DEFAULT_DB_ALIAS]
    # beside the site's own connection and unknown to Django's register of them: only cursors are asked of it
    old = load_backend(settings["ENGINE"]).DatabaseWrapper(settings)
    try:
        if old.vendor != vendor:
            raise UserFault("carry_other_kind", theirs=old.vendor, ours=vendor)
        yield old
    finally:
        old.close()


def _check(source: str, old: BaseDatabaseWrapper) -> None:
    try:
        there = is_from_before(old)
        with old.cursor() as cursor:
            cursor.execute("SELECT app, name FROM django_migrations")
            applied = set(cursor.fetchall())
    except DatabaseError as error:
        raise UserFault("carry_unreadable", path=source, problem=str(error).strip()) from error
    missing = [f"{app}.{name}" for app, name in LAST.items() if (app, name) not in applied]
    if not there or missing:
        raise UserFault("carry_other_state", path=source, found=", ".join(missing) or _MARK)


def _tables() -> list[type[models.Model]]:
    return [
        model
        for model in apps.get_models(include_auto_created=True)
        if model._meta.managed and not model._meta.proxy and model._meta.db_table not in MADE_ANEW
    ]


def _columns(connection: BaseDatabaseWrapper, table: str) -> list[str]:
    with connection.cursor() as cursor:
        if table not in connection.introspection.table_names(cursor):
            return []
        return [column.name for column in connection.introspection.get_table_description(cursor, table)]


def _untold(old: BaseDatabaseWrapper, tables: Sequence[type[models.Model]]) -> list[str]:
    """Tables and columns of the old database that the new one has no place for."""
    places: dict[str, set[str]] = {}
    for model in tables:
        taken = {was for field in model._meta.local_concrete_fields for was in _of(model, field)}
        places.setdefault(TABLES.get(model._meta.db_table, model._meta.db_table), set()).update(taken)
    found = []
    for table in old.introspection.table_names():
        if table in MADE_ANEW:
            continue
        taken = places.get(table, set())
        found += [
            f"{table}.{column}"
            for column in _columns(old, table)
            if column not in taken and (table, column) not in DROPPED
        ]
    return found


def _place(model: type[models.Model], field: models.Field) -> tuple[str, str]:
    """The table and the column of a field that has one."""
    assert field.column is not None, "a concrete field"
    return model._meta.db_table, field.column


def _of(model: type[models.Model], field: models.Field) -> tuple[str, ...]:
    """The old columns that a new one is made of."""
    place = _place(model, field)
    return MADE[place][0] if place in MADE else (COLUMNS.get(place, place[1]),)


def _made(model: type[models.Model], field: models.Field, old: BaseDatabaseWrapper) -> Callable[..., Any]:
    """What makes a new column's value of the old ones'."""
    place = _place(model, field)
    if place in MADE:
        return MADE[place][1]
    if field.is_relation and field.related_model in (ContentType, Permission):
        return _renumbered(field.related_model, old).get
    return lambda value: value


def _copy(old: BaseDatabaseWrapper, new: BaseDatabaseWrapper, model: type[models.Model]) -> int:
    """Copy the rows of one table. What is new gets its default; a row that points to a permission or a kind of thing
    that is no more is left out."""
    table = model._meta.db_table
    there = set(_columns(old, TABLES.get(table, table)))
    if not there:
        return 0
    fields = model._meta.local_concrete_fields
    copied = [field for field in fields if there.issuperset(_of(model, field))]
    added = [field for field in fields if field not in copied and not field.has_db_default() and not field.null]
    fixed = [field.get_db_prep_save(field.get_default(), new) for field in added]
    makers = [(len(_of(model, field)), _made(model, field, old), field.null) for field in copied]
    quote = new.ops.quote_name
    wanted = ", ".join(quote(was) for field in copied for was in _of(model, field))
    names = ", ".join(quote(_place(model, field)[1]) for field in (*copied, *added))
    places = ", ".join(["%s"] * len([*copied, *added]))
    count = 0
    with old.cursor() as source, new.cursor() as target:
        source.execute(f"SELECT {wanted} FROM {quote(TABLES.get(table, table))}")
        while rows := source.fetchmany(_ROWS):
            carried = []
            for row in rows:
                values, rest = [], iter(row)
                for width, make, _null in makers:
                    values.append(make(*islice(rest, width)))
                if all(value is not None or null for value, (_width, _make, null) in zip(values, makers, strict=True)):
                    carried.append([*values, *fixed])
            target.executemany(f"INSERT INTO {quote(table)} ({names}) VALUES ({places})", carried)
            count += len(carried)
    return count


def _renumbered(related: Any, old: BaseDatabaseWrapper) -> dict[int, int]:
    """The new ids of content types or permissions by the old ones; they are told apart by their names."""
    with old.cursor() as cursor:
        cursor.execute("SELECT id, app_label, model FROM django_content_type")
        types = {(app, name): key for key, app, name in cursor.fetchall()}
        cursor.execute("SELECT id, content_type_id, codename FROM auth_permission")
        permissions = {(kind, code): key for key, kind, code in cursor.fetchall()}
    found: dict[int, int] = {}
    for kind in ContentType.objects.all():
        app, model = MODELS.get((kind.app_label, kind.model), (kind.app_label, kind.model))
        was = types.get((app, model))
        if was is None:
            continue
        if related is ContentType:
            found[was] = kind.pk
            continue
        for permission in Permission.objects.filter(content_type=kind):
            codename = permission.codename
            if codename.endswith(f"_{kind.model}"):
                codename = codename.removesuffix(kind.model) + model
            if (one := permissions.get((was, codename))) is not None:
                found[one] = permission.pk
    return found
