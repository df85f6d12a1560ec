"""The stored files of videos: a video and its still each, under names that nobody can guess."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from django.core.files.base import ContentFile, File
from django.core.files.storage import Storage
from django.db import transaction
from django.db.models import Q

from core.storage_faults import storage_at_work

from ..models import Video

logger = logging.getLogger(__name__)
FOLDER = "videos"
# What a row without a file says of it.
NO_FILE = {
    **dict.fromkeys(("fingerprint", "file", "poster", "sha256"), ""),
    **dict.fromkeys(("size", "duration_ms", "width", "height"), 0),
    "watched_at": None,
}


def storage() -> Storage:
    """Where videos are kept: the site's storage of files."""
    return Video._meta.get_field("file").storage


def names_of(video: Video) -> tuple[str, str]:
    """The names of the video's file and its still that are made under the video's present lease. Nobody else's, so that
    whoever finds the lease run out may delete what its worker left."""
    stem = f"{FOLDER}/{video.public_id}-{video.attempt}-{video.lease}"
    return f"{stem}.mp4", f"{stem}.jpg"


def store(video: Video, drawn: Path, still: bytes) -> tuple[str, str]:
    """Store both; both or none. The names under which they are. Raises PlatformFault("storage_failed")."""
    stored: list[str] = []
    with ExitStack() as undo:
        undo.callback(delete_files, stored)
        with storage_at_work(), drawn.open("rb") as file:
            for name, content in zip(names_of(video), (File(file), ContentFile(still)), strict=True):
                stored.append(storage().save(name, content))
        undo.pop_all()
    return stored[0], stored[1]


def digest_of(drawn: Path) -> str:
    """The sha-256 of a file, read in pieces."""
    with drawn.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def delete_files(names: Iterable[str | None]) -> None:
    """Delete those files that no video refers to. What cannot be deleted now is logged, and purged later."""
    for name in filter(None, names):
        try:
            # a commit whose answer got lost may have gone through all the same
            if not Video.objects.filter(Q(file=name) | Q(poster=name)).exists():
                storage().delete(name)
        except Exception:  # storages raise errors of their own
            logger.exception("The unused file %s could not be deleted.", name)


def delete_files_on_commit(names: Iterable[str | None]) -> None:
    """:func:`delete_files` once the current transaction is committed."""
    transaction.on_commit(partial(delete_files, list(names)), robust=True)
