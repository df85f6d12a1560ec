"""Keeping, changing and removing a racer's picture."""

import logging
from datetime import datetime
from functools import partial
from typing import IO

from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.db import transaction
from django.db.models import Sum
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from core.files.storage_faults import storage_at_work
from paddock.errors import PlatformFault, UserFault

from ..models import Racer
from ..quotas import CountedRows, Racers, limit_of, only, used_by
from ..usage.storage import Shelf

logger = logging.getLogger(__name__)
FOLDER = "avatars"


def path_of(name: str) -> str:
    return f"{FOLDER}/{name}.webp"


def set_picture(*, racer: Racer, file: IO[bytes], now: datetime) -> Racer:
    """Replace the racer's picture. Raises UserFault("storage_full"), PlatformFault, and as
    :func:`.reading.read_picture`."""
    from .reading import read_picture  # loads Pillow

    content = read_picture(file)
    limit_mb = limit_of(racer, "storage_mb")
    if used_by(racer, "storage_mb", now) >= limit_mb:
        raise UserFault("storage_full", limit_mb=limit_mb)
    name = get_random_string(24)
    with storage_at_work():
        default_storage.save(path_of(name), ContentFile(content))
    try:
        _put(racer, name, len(content))
    except BaseException:
        _delete(name)
        raise
    return racer


def remove_picture(*, racer: Racer) -> bool:
    """The racer is shown by the drawn picture again; False where there was no other."""
    had = racer.avatar is not None
    if had:
        _put(racer, None, 0)
    return had


def open_picture(name: str) -> IO[bytes]:
    """The stored picture that some racer has. Raises PlatformFault("storage_failed")."""
    with storage_at_work():
        return default_storage.open(path_of(name))


@transaction.atomic
def _put(racer: Racer, name: str | None, size: int) -> None:
    before = Racer.objects.select_for_update(no_key=True).values_list("avatar", flat=True).get(pk=racer.pk)
    racer.avatar, racer.avatar_bytes = name, size
    racer.save(update_fields=["avatar", "avatar_bytes"])
    if before:
        transaction.on_commit(partial(_delete, before))


def take_picture_along(sender: object, *, instance: Racer, **kwargs: object) -> None:
    """A receiver of ``post_delete``: however an account goes, its picture goes with it."""
    if instance.avatar:
        transaction.on_commit(partial(_delete, instance.avatar))


def _delete(name: str) -> None:
    try:
        with storage_at_work():
            default_storage.delete(path_of(name))
    except PlatformFault as fault:
        logger.warning("The picture %s could not be deleted: %s", name, fault)


def _pictures(racers: Racers) -> list[CountedRows]:
    found = only(Racer.objects.filter(avatar__isnull=False), "pk", racers)
    return [found.order_by().values_list("pk").annotate(Sum("avatar_bytes"))]


PICTURES = Shelf(6, "pictures", _("Your picture"), _pictures)
