"""One change at a time for one row, on every database."""

from __future__ import annotations

from django.db.models import Model


def hold(row: Model) -> None:
    """Until the transaction ends, nobody else gets past ``hold`` with the same row.

    A row lock on PostgreSQL that leaves foreign keys free; on SQLite the transaction holds the write lock already.
    ``row`` may be ``request.user``, which is a lazy stand-in for a racer. Raises DoesNotExist when the row is gone.
    """
    row._meta.model._base_manager.select_for_update(no_key=True).only("pk").get(pk=row.pk)
