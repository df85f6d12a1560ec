"""The stored files of a site: which the database refers to, and what lies in the storage."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import IO, Any

from django.apps import apps
from django.core.files.storage import Storage, default_storage
from django.db.models import FileField

from paddock.errors import PlatformFault

from .archive import PIECE


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
    except Exception as error:  # storages raise errors of their own
        raise PlatformFault("storage_failed") from error
    yield from (f"{folder}{name}" for name in files if name)
    for inner in folders:
        if inner.strip("/"):
            yield from stored(f"{folder}{inner.strip('/')}/", storage)


def digest(content: IO[bytes]) -> str:
    """The sha-256 of an open file, read in pieces."""
    sum_ = hashlib.sha256()
    while piece := content.read(PIECE):
        sum_.update(piece)
    return sum_.hexdigest()
