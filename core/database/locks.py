"""A lock of one row that works on every database."""

from django.db.models import Model


def hold(row: Model) -> None:
    """Lock a row (or a lazy ``request.user``) until the transaction ends, foreign keys free. Raises DoesNotExist."""
    row._meta.model._base_manager.select_for_update(no_key=True).only("pk").get(pk=row.pk)
