"""``migrate`` that builds an empty database at once, and ignores changed texts
(:mod:`core.database.migration_detector`)."""

from typing import Any

from django.apps import apps
from django.core.management.commands.migrate import Command as DjangoCommand
from django.core.management.sql import emit_post_migrate_signal, emit_pre_migrate_signal
from django.db import connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.migrations.executor import MigrationExecutor
from django.db.migrations.recorder import MigrationRecorder

from core.database.known_migrations import applied_are_all
from core.database.migration_detector import TextBlindAutodetector

# Options that ask for something else than all migrations, really run
_OTHER_REQUESTS = ("app_label", "migration_name", "plan", "check_unapplied", "fake", "fake_initial", "prune")


class Command(DjangoCommand):
    autodetector = TextBlindAutodetector

    def handle(self, *args: Any, **options: Any) -> None:
        if not any(options[name] for name in _OTHER_REQUESTS):
            is_new = build_empty_database(connections[options["database"]])
            if not is_new and not options["verbosity"] and nothing_to_migrate(options["database"]):
                return
        super().handle(*args, **options)


def nothing_to_migrate(database: str) -> bool:
    """Whether all migrations are applied. Then send Django's signals, whose receivers complete what an interruption or
    a restored backup left out, with the models as they are: to build them from all migrations takes longer."""
    if not applied_are_all(MigrationRecorder(connections[database])):
        return False
    for emit in (emit_pre_migrate_signal, emit_post_migrate_signal):
        emit(verbosity=0, interactive=False, db=database, apps=apps, plan=[])
    return True


def build_empty_database(connection: BaseDatabaseWrapper) -> bool:
    """Create all tables in their last form and record all migrations. Returns False, and does nothing, if there are
    tables."""
    if set(connection.introspection.table_names()) - {MigrationRecorder.Migration._meta.db_table}:
        return False
    executor: Any = MigrationExecutor(connection)  # the stubs have another signature of record_migration
    if executor.loader.applied_migrations:
        return False
    state = executor.loader.project_state()
    with connection.schema_editor() as editor:
        if not executor.recorder.has_table():
            editor.create_model(executor.recorder.Migration)
        for app_label, name in state.models:
            model = state.apps.get_model(app_label, name)
            if model._meta.can_migrate(connection):
                editor.create_model(model)
        for migration, _backwards in executor.migration_plan(executor.loader.graph.leaf_nodes()):
            executor.record_migration(migration)
    return True
