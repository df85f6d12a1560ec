"""The original upload of a model, kept for its owner and deleted with the model.

A training's folder holds the reward function, which stays private when the model is shared.
"""

import re
import tempfile
import uuid
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from typing import BinaryIO

from django.core.files import File
from django.core.files.storage import default_storage
from django.utils import timezone

from core.database.after_commit import after_commit
from core.database.columns import length_of
from core.files.storage_faults import storage_at_work
from paddock.packages.read import UploadPart

from ..models import TrainedModel
from ..stored_files import delete, store_file

FOLDER = "uploads"
NAME_LIMIT = length_of(TrainedModel, "source_name")
_IN_MEMORY = 8 << 20
_PIECE = 1 << 20
_UNSAFE = re.compile(r"[^\w.\-]+")


def store_source(files: Sequence[UploadPart]) -> tuple[str, str]:
    """Store an upload, several files as one zip. Returns the names of the stored and of the sent file. Raises
    PlatformFault ``storage_failed``."""
    name = _safe(files[0].name) if len(files) == 1 else "upload.zip"
    with storage_at_work(), _as_one(files) as stream:
        return store_file(f"{FOLDER}/{uuid.uuid4().hex}", File(stream)), name


def drop_source(model: TrainedModel) -> None:
    """Delete a model's upload, once the transaction is committed."""
    if model.source_file:
        _delete_on_commit(model.source_file.name or "")
        TrainedModel.objects.filter(pk=model.pk).update(source_file="")
        model.refresh_from_db(fields=["source_file"])


def take_source_along(sender: object, *, instance: TrainedModel, **kwargs: object) -> None:
    """A receiver of ``post_delete``: the file goes with its row."""
    if instance.source_file:
        _delete_on_commit(instance.source_file.name or "")


def delete_unnamed_sources(before: datetime) -> None:
    """Delete files of uploads that were cut short between storing and writing the row."""
    with suppress(OSError):  # no folder yet
        for name in (f"{FOLDER}/{one}" for one in default_storage.listdir(FOLDER)[1]):
            with suppress(OSError):  # somebody else deleted it
                stored_at = default_storage.get_modified_time(name)
                aware = stored_at if timezone.is_aware(stored_at) else timezone.make_aware(stored_at)
                if aware < before and not TrainedModel.objects.filter(source_file=name).exists():
                    delete(name)


def _delete_on_commit(name: str) -> None:
    after_commit(delete, name)


@contextmanager
def _as_one(files: Sequence[UploadPart]) -> Iterator[BinaryIO]:
    """The only file of an upload, from its beginning, or all of them in a zip."""
    for file in files:
        file.stream.seek(0)
    if len(files) == 1:
        yield files[0].stream
        return
    with tempfile.SpooledTemporaryFile(_IN_MEMORY) as packed:
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
            names: set[str] = set()
            for number, file in enumerate(files):
                name = _safe(file.name)
                name = name if name not in names else f"{number}-{name}"
                names.add(name)
                with archive.open(name, "w", force_zip64=True) as member:
                    while piece := file.stream.read(_PIECE):
                        member.write(piece)
        packed.seek(0)
        yield packed  # type: ignore[misc]  # a SpooledTemporaryFile is a binary file in all but its type


def _safe(name: str) -> str:
    """A sender's name of a file, without folders and without what file systems stumble over."""
    last = re.split(r"[\\/]", name)[-1]
    return _UNSAFE.sub("-", last).strip(".-")[-NAME_LIMIT:] or "model"
