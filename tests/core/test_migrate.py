"""An empty database is built at once, and is the same as after each migration by itself."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from hashlib import sha256
from pathlib import Path

import psycopg
import pytest
from django.core.management import call_command
from django.core.management.commands import migrate as djangos
from django.db import connections
from django.db.migrations.loader import MigrationLoader
from django.db.migrations.recorder import MigrationRecorder

from core.database.known_migrations import known_migrations
from core.management.commands.migrate import build_empty_database
from tests.database import digest
from tests.postgres import is_installed, postgres
from tests.shared import CHECKOUT

COLUMNS = (
    "table_name, column_name, data_type, is_nullable, column_default, character_maximum_length, numeric_precision, "
    "numeric_scale, is_identity, collation_name"
)
POSTGRESQL = (
    f"SELECT {COLUMNS} FROM information_schema.columns WHERE table_schema = 'public'",
    "SELECT conrelid::regclass::text, conname, pg_get_constraintdef(oid) FROM pg_constraint WHERE conrelid <> 0",
    "SELECT indexdef FROM pg_indexes WHERE schemaname = 'public'",
    "SELECT pg_get_triggerdef(oid) FROM pg_trigger WHERE NOT tgisinternal",
    "SELECT sequencename, data_type::text FROM pg_sequences WHERE schemaname = 'public'",
    "SELECT proname, prosrc FROM pg_proc WHERE pronamespace = 'public'::regnamespace",
)


def run(data: Path, command: list[str], url: str) -> None:
    environment = {**os.environ, "DATABASE_URL": url, "PADDOCK_DATA": str(data)}
    environment["DJANGO_SETTINGS_MODULE"] = "config.settings"
    subprocess.run([sys.executable, *command], cwd=CHECKOUT, env=environment, check=True, timeout=300)


def facts(columns: list[str], table: str, rows: list) -> list[str]:
    """Each row by the names of its columns; of a migration without the moment it ran at, and when among others."""
    skipped = ("id", "applied") if table == "django_migrations" else ()
    named = ({name: value for name, value in zip(columns, row, strict=True) if name not in skipped} for row in rows)
    return [f"{table}: {json.dumps(row, sort_keys=True, default=str)}" for row in named]


def sqlite_facts(path: Path) -> list[str]:
    """Every part of each table's declaration, index, trigger and row. Columns may stand in another order."""
    found = []
    with closing(sqlite3.connect(path)) as database:
        stated = "SELECT type, name, sql FROM sqlite_master WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite_%'"
        for kind, name, sql in database.execute(stated).fetchall():
            parts = re.split(r'[(,] (?=CONSTRAINT|")|\((?=")', sql.removesuffix(")")) if kind == "table" else [sql]
            found += [f"{name}: {part}" for part in parts]
            if kind == "table":
                rows = database.execute(f'SELECT * FROM "{name}"')
                found += facts([column[0] for column in rows.description], name, rows.fetchall())
    return sorted(found)


def postgresql_facts(url: str) -> list[str]:
    with psycopg.connect(url) as database:
        found = [str(row) for query in POSTGRESQL for row in database.execute(query).fetchall()]
        for (table,) in database.execute("SELECT tablename FROM pg_tables WHERE schemaname = 'public'").fetchall():
            rows = database.execute(f'SELECT * FROM "{table}"')
            found += facts([column.name for column in rows.description or ()], table, rows.fetchall())
    return sorted(found)


@contextmanager
def database(vendor: str, folder: Path) -> Iterator[tuple[str, Callable[[], list[str]]]]:
    """The address of an empty database, and what asks for its facts."""
    if vendor == "sqlite":
        path = folder / f"{len(list(folder.iterdir()))}.sqlite3"
        yield f"sqlite:///{path}", partial(sqlite_facts, path)
    else:
        with postgres() as url:
            yield url, partial(postgresql_facts, url)


@pytest.fixture(scope="module")
def by_steps(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """The facts of each kind of database after every migration by itself, which takes half a minute: what came of them
    is kept until one changes."""
    migrations = json.dumps(sorted(MigrationLoader(None).disk_migrations))
    vendors = ["sqlite", *(["postgresql"] if is_installed() else [])]
    key = f"every_migration/{'-'.join(vendors)}/{digest(sha256(migrations.encode()).hexdigest())}"
    cache = getattr(request.config, "cache", None)
    found = cache and cache.get(key, None)
    if not found:
        folder = tmp_path_factory.mktemp("by_steps")
        with ExitStack() as opened:
            made = {vendor: opened.enter_context(database(vendor, folder)) for vendor in vendors}
            urls = [url for url, _facts in made.values()]
            run(folder, ["-m", "tests.core.every_migration", *urls], urls[0])
            found = {vendor: facts() for vendor, (_url, facts) in made.items()}
        if cache:
            cache.set(key, found)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("vendor", ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)])
def test_a_database_built_at_once_is_the_same_as_one_of_every_migration(vendor, by_steps, tmp_path):
    if vendor not in by_steps:
        pytest.skip("PostgreSQL is not installed")
    assert len(by_steps[vendor]) > 1000
    with database(vendor, tmp_path) as (url, facts):
        run(tmp_path, ["manage.py", "migrate", "--verbosity", "0"], url)
        assert facts() == by_steps[vendor]


@pytest.fixture
def empty(tmp_path, django_db_blocker) -> Iterator[str]:
    """The alias of an empty SQLite database."""
    alias = "empty"
    connections.settings[alias] = connections.configure_settings(
        {"default": {"ENGINE": "django.db.backends.sqlite3", "NAME": str(tmp_path / "empty.sqlite3")}}
    )["default"]
    with django_db_blocker.unblock():
        yield alias
        connections[alias].close()
    del connections[alias], connections.settings[alias]


def tables(alias: str) -> list[str]:
    return connections[alias].introspection.table_names()


def columns(alias: str, table: str) -> set[str]:
    with connections[alias].cursor() as cursor:
        return {column.name for column in connections[alias].introspection.get_table_description(cursor, table)}


def migrated(alias: str) -> list[str]:
    call_command("migrate", database=alias, verbosity=0)
    return sqlite_facts(Path(connections[alias].settings_dict["NAME"]))


def test_an_interrupted_build_leaves_an_empty_database_that_the_next_one_builds(empty, monkeypatch):
    ours = MigrationRecorder.record_applied

    def interrupt(recorder: MigrationRecorder, app: str, name: str) -> None:
        if app == "videos":
            raise KeyboardInterrupt
        ours(recorder, app, name)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(MigrationRecorder, "record_applied", interrupt)
        migrated(empty)
    assert tables(empty) == []
    MigrationRecorder(connections[empty]).ensure_schema()  # as a build by steps may leave it
    assert any("races_board" in fact and "TRIGGER" in fact for fact in migrated(empty))


def test_an_interruption_after_the_build_loses_no_permission_and_no_trigger(empty, monkeypatch):
    def interrupt(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(djangos, "emit_post_migrate_signal", interrupt)
        migrated(empty)
    assert "races_entry" in tables(empty)
    facts = migrated(empty)
    assert any("TRIGGER races_board" in fact for fact in facts)
    assert any(fact.startswith("auth_permission: ") and "change_race" in fact for fact in facts)


def test_known_migrations_are_those_that_django_loads():
    loader = MigrationLoader(None)
    replaced = {name for migration in loader.disk_migrations.values() for name in migration.replaces}
    assert known_migrations() == set(loader.graph.nodes) | replaced


def test_no_migration_is_loaded_for_a_database_that_has_all(empty, monkeypatch):
    whole = migrated(empty)
    with monkeypatch.context() as patch:
        patch.setattr(MigrationLoader, "load_disk", lambda loader: pytest.fail("loaded"))
        assert migrated(empty) == whole


def test_a_database_that_has_all_migrations_gets_back_what_it_has_lost(empty):
    whole = migrated(empty)
    with connections[empty].cursor() as cursor:
        cursor.execute("DELETE FROM auth_permission WHERE codename = 'change_race'")
        triggers = "SELECT name FROM sqlite_master WHERE type = 'trigger' AND name LIKE 'races_board%'"
        for (name,) in cursor.execute(triggers).fetchall():
            cursor.execute(f"DROP TRIGGER {name}")
    ids = re.compile(r'"id": \d+')
    assert [ids.sub("", fact) for fact in migrated(empty)] == [ids.sub("", fact) for fact in whole]


def test_an_older_database_gets_the_migrations_that_it_lacks(empty):
    migrated(empty)
    call_command("migrate", "training", "0007", database=empty, verbosity=0)
    assert "request_id" not in columns(empty, "training_trainingjob")
    migrated(empty)
    assert "request_id" in columns(empty, "training_trainingjob")


def test_a_database_with_tables_is_left_to_the_migrations(empty):
    with connections[empty].cursor() as cursor:
        cursor.execute("CREATE TABLE somebodys (id integer)")
    assert not build_empty_database(connections[empty])
    assert tables(empty) == ["somebodys"]


def test_a_database_that_says_it_is_migrated_is_left_to_the_migrations(empty):
    MigrationRecorder(connections[empty]).record_applied("core", "0001_initial")
    assert not build_empty_database(connections[empty])


@pytest.mark.parametrize("arguments", [["contenttypes"], ["--plan"], ["--fake"]])
def test_a_request_for_less_than_all_migrations_is_djangos(empty, arguments, monkeypatch):
    monkeypatch.setattr("core.management.commands.migrate.build_empty_database", pytest.fail)
    call_command("migrate", *arguments, database=empty, verbosity=0)
