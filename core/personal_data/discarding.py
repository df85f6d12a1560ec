"""Deletes stored files after the commit that removed their rows; a sweep repeats what a crash or a fault left."""

import logging
from collections.abc import Collection, Iterable
from datetime import datetime

from django.apps import apps
from django.core.files.storage import default_storage
from django.db.models import FileField

from ..database.after_commit import after_commit
from .models import DiscardedFile

logger = logging.getLogger(__name__)
AT_ONCE = 500


def discard_files(names: Iterable[str | None], *, now: datetime) -> None:
    """Delete files once the current transaction is committed. Names no file that a row still has."""
    wanted = sorted({name for name in names if name})
    DiscardedFile.objects.bulk_create(
        [DiscardedFile(name=name, at=now) for name in wanted], batch_size=AT_ONCE, ignore_conflicts=True
    )
    if wanted:
        after_commit(delete_discarded, wanted)


def delete_discarded(names: Collection[str] | None = None) -> int:
    """Delete discarded files, of these names or all; the number of deleted ones. A file that a row has again stays."""
    rows = DiscardedFile.objects.order_by("at", "pk")
    deleted = 0
    for row in rows if names is None else rows.filter(pk__in=names):
        try:
            if not _is_named(row.name):
                default_storage.delete(row.name)
                deleted += 1
            row.delete()
        except Exception as error:  # each storage raises other classes
            logger.warning("The discarded file %s could not be deleted: %s", row.name, error)
    return deleted


def _is_named(name: str) -> bool:
    return any(
        model._base_manager.filter(**{column.name: name}).exists()
        for model in apps.get_models()
        for column in model._meta.concrete_fields
        if isinstance(column, FileField) and not model._meta.proxy
    )
