"""The names of this code's migrations, without loading them."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from django.apps import apps
from django.db.migrations.loader import MigrationLoader
from django.db.migrations.recorder import MigrationRecorder


@cache
def known_migrations() -> frozenset[tuple[str, str]]:
    """App and name of each, read once per process. Of a squashed one also those that it replaces: Django records
    both."""
    labels = [config.label for config in apps.get_app_configs()]
    modules = {label: MigrationLoader.migrations_module(label)[0] for label in labels}
    return frozenset(
        (label, found.name)
        for label, module in modules.items()
        if module and (folder := _folder(module))
        for found in iter_modules(folder)
        if not found.ispkg and found.name[0] not in "_~"
    )


def applied_are_all(recorder: MigrationRecorder) -> bool:
    """Whether all known migrations have been made. A newer site may have made more."""
    return known_migrations() <= recorder.applied_migrations().keys()


def _folder(module: str) -> list[str]:
    try:
        return list(import_module(module).__path__)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return []  # an app without migrations
