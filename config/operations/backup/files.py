"""The stored files of a site, and the working folder of a backup or a restore."""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from django.apps import apps
from django.core.files.storage import Storage, default_storage
from django.db.models import FileField

from paddock.errors import PlatformFault

_NOW = fcntl.LOCK_EX | fcntl.LOCK_NB


def file_columns() -> list[tuple[str, str]]:
    """Table and column of everything that names a stored file."""
    return sorted(
        {
            (field.model._meta.db_table, field.column)
            for model in apps.get_models(include_auto_created=True)
            for field in model._meta.concrete_fields
            if isinstance(field, FileField) and field.column
        }
    )


def referred_to(ask: Callable[[str], Any]) -> set[str]:
    """The names of all files that a database refers to. ``ask``: gives the rows of a statement of SQL."""
    names: set[str] = set()
    for table, column in file_columns():
        names.update(row[0] for row in ask(f'SELECT DISTINCT "{column}" FROM "{table}" WHERE "{column}" <> \'\''))
    return names


def is_referred_to(ask: Callable[[str, list[str]], Any], name: str) -> bool:
    """Whether any row names this file. ``ask``: as in :func:`referred_to`, with parameters."""
    return any(
        ask(f'SELECT 1 FROM "{table}" WHERE "{column}" = %s LIMIT 1', [name]) for table, column in file_columns()
    )


def stored(folder: str = "", storage: Storage = default_storage) -> Iterator[str]:
    """The names of all files in the storage, of whatever kind. Raises PlatformFault ``storage_failed``."""
    try:
        folders, files = storage.listdir(folder)
    except FileNotFoundError:
        return
    except Exception as error:  # each storage raises other classes
        raise PlatformFault("storage_failed") from error
    yield from (f"{folder}{name}" for name in files if name)
    for inner in folders:
        if inner.strip("/"):
            yield from stored(f"{folder}{inner.strip('/')}/", storage)


@contextmanager
def working_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """A private folder in ``parent``, deleted at the end. Its process holds a lock on it: a folder of this prefix
    without a lock is abandoned, and is deleted first. A file system without locks keeps abandoned folders."""
    for abandoned in parent.glob(f"{prefix}*/"):
        with suppress(OSError), _open(abandoned) as descriptor:
            fcntl.flock(descriptor, _NOW)
            shutil.rmtree(abandoned)
    while True:
        with tempfile.TemporaryDirectory(prefix=prefix, dir=parent) as name, _open(Path(name)) as descriptor:
            with suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if os.path.isdir(name):  # another process can delete the folder before the lock is held
                yield Path(name)
                return


@contextmanager
def _open(folder: Path) -> Iterator[int]:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        yield descriptor
    finally:
        os.close(descriptor)
