"""Apply every migration, one after the other, to all databases whose addresses are given.

    python -m tests.core.every_migration sqlite:////tmp/a.sqlite3 postgres://…

It is Django's own ``migrate``; the states of the models, which take most of its time, are drawn once for all databases.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from unittest.mock import patch

import django
from django.core.management import call_command
from django.core.management.commands import migrate
from django.db import connections
from django.db.migrations.executor import MigrationExecutor
from django.db.migrations.migration import Migration
from django.db.migrations.state import ProjectState

from config.settings.env import env_database


class ExecutorOfAll(MigrationExecutor):
    """Applies a migration to every database, as Django does to one."""

    def apply_migration(self, state: ProjectState, migration: Migration, **_: object) -> ProjectState:
        assert migration.atomic, "each operation would need a transaction of its own"
        with ExitStack() as opened:
            editors = [opened.enter_context(each.schema_editor(atomic=True)) for each in connections.all()]
            for operation in migration.operations:
                before = state.clone()
                operation.state_forwards(migration.app_label, state)
                for editor in editors:
                    operation.database_forwards(migration.app_label, editor, before, state)
        for each in connections.all():
            MigrationExecutor(each).record_migration(migration)
        return state


def told_to_all(emit: Callable[..., None]) -> Callable[..., None]:
    """One of Django's signals, sent for every database."""

    def emit_all(verbosity: int, interactive: bool, _alias: str, **given: object) -> None:
        for alias in connections:
            emit(verbosity, interactive, alias, **given)

    return emit_all


def apply_every_migration(addresses: list[str]) -> None:
    databases = {str(number): env_database("", address) for number, address in enumerate(addresses)}
    connections.settings = connections.configure_settings({"default": databases.pop("0"), **databases})
    signals = ("emit_pre_migrate_signal", "emit_post_migrate_signal")
    with ExitStack() as patched:
        patched.enter_context(patch.object(migrate, "MigrationExecutor", ExecutorOfAll))
        for name in signals:
            patched.enter_context(patch.object(migrate, name, told_to_all(getattr(migrate, name))))
        call_command(migrate.Command(), verbosity=0)


if __name__ == "__main__":
    django.setup()
    apply_every_migration(sys.argv[1:])
