"""Stored files with checksums: written, read back only unchanged, checked at night.

A changed file is the platform's fault: reading it raises ``file_damaged`` until its bytes are back.
"""

import gzip
import hashlib
import json
import logging
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime, timedelta
from os.path import splitext
from pathlib import Path
from time import monotonic

from django.apps import apps
from django.core.files.base import ContentFile, File
from django.core.files.storage import FileSystemStorage, default_storage
from django.db import transaction
from django.db.models import Exists, F, FileField, Model, OuterRef, Q, Sum, Value
from django.db.models.functions import StrIndex, Substr
from django.utils import timezone

from core.files.storage_faults import storage_at_work
from paddock.errors import PlatformFault, UserFault
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import identity, parse_metadata

from .models import Damage, Network, StoredFile

logger = logging.getLogger(__name__)
CHECKED_EVERY = timedelta(days=7)
SCRUB_S = 10.0  # of a turn: evaluations wait behind it
UNSUMMED = ("videos/",)  # videos have sums of their own, and are drawn anew
_PIECE = 1 << 20


def store(name: str, content: bytes) -> str:
    """Store a file and note its sum; the name that it got. Raises whatever the storage raises."""
    return store_file(name, ContentFile(content))


def store_file(name: str, content: File) -> str:
    """As :func:`store`, for a file too large for memory, from its beginning."""
    if not isinstance(default_storage, FileSystemStorage):  # a bucket reserves no name for one of two writers
        name = default_storage.get_alternative_name(*splitext(name))
    content.seek(0)
    sha256, size = _summed(content)
    content.seek(0)
    with ExitStack() as unless_noted:
        stored = default_storage.save(name, content)
        unless_noted.callback(default_storage.delete, stored)
        _note(stored, sha256, size)
        unless_noted.pop_all()
    return stored


def open_stored(name: str) -> File:
    """A stored file as it was written, to be read from its beginning. The caller closes it.

    Raises PlatformFault ``storage_failed``, ``file_damaged``, before a byte of it is sent."""
    known = StoredFile.objects.filter(name=name).first()
    try:
        with _at_storage(name):
            file = default_storage.open(name, "rb")
            sha256, _size = _summed(file)
            file.seek(0)
    except FileNotFoundError as error:
        raise _damaged(name, Damage.MISSING) from error
    if known is not None and sha256 != known.sha256:
        file.close()
        raise _damaged(name, Damage.ALTERED)
    return file


def read(name: str) -> bytes:
    """A stored file as it was written. Raises PlatformFault ``storage_failed``, ``file_damaged``."""
    known = StoredFile.objects.filter(name=name).first()
    try:
        with _at_storage(name), default_storage.open(name, "rb") as file:
            content = file.read()
    except FileNotFoundError as error:
        raise _damaged(name, Damage.MISSING) from error
    if known is not None:
        if hashlib.sha256(content).hexdigest() != known.sha256:
            raise _damaged(name, Damage.ALTERED)
        if known.damage:
            StoredFile.objects.filter(name=name).update(damage="", damaged_at=None)
    return content


@contextmanager
def _at_storage(name: str) -> Iterator[None]:
    """Turn the storage's errors into ``storage_failed``. Raises FileNotFoundError where only the file is missing."""
    try:
        yield
    except FileNotFoundError as error:
        if _is_away(name):
            raise PlatformFault("storage_failed") from error
        raise
    except Exception as error:  # each storage raises other classes
        raise PlatformFault("storage_failed") from error


def _summed(file: File) -> tuple[str, int]:
    """The sha-256 and the size of an open file, from where it stands."""
    digest, size = hashlib.sha256(), 0
    while piece := file.read(_PIECE):
        digest.update(piece)
        size += len(piece)
    return digest.hexdigest(), size


def read_gzip(name: str) -> bytes:
    """The content of a stored file that is gzipped. Raises PlatformFault ``storage_failed``, ``file_damaged``."""
    content = read(name)
    try:
        if not content:  # gzip takes no bytes for an archive of nothing
            raise EOFError
        return gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise _damaged(name, Damage.ALTERED) from error


def delete(name: str) -> None:
    """Delete a file and its sum; what is gone already is no matter. Raises whatever the storage raises."""
    StoredFile.objects.filter(name=name).delete()
    default_storage.delete(name)


def bytes_by_folder() -> dict[str, int]:
    """The size of all stored files with a sum, by their folder: one query over all of them."""
    folder = Substr("name", 1, StrIndex("name", Value("/")) - 1)
    sizes = StoredFile.objects.order_by().values_list(folder).annotate(Sum("size"))
    return {name or "other": size for name, size in sizes}


def heal_network(sha256: str, onnx: bytes) -> bool:
    """Store a known network once more if its file is damaged. ``onnx``: its bytes, admitted just now. Whether it was
    done. Raises PlatformFault ``storage_failed``."""
    network = Network.objects.filter(pk=sha256).first()
    if network is None:
        return False
    old = network.onnx.name or ""
    try:
        if read(old) == onnx:
            return False
    except PlatformFault as fault:
        if fault.code != "file_damaged":
            raise
    with storage_at_work():
        new = store(f"networks/{sha256}.onnx", onnx)
    if not Network.objects.filter(pk=sha256, onnx=old).update(onnx=new):  # another upload was quicker
        delete(new)
        return False
    if new != old:  # a missing one gets its old name again
        delete(old)
    logger.warning("The damaged file of network %s was replaced by an upload of the same network.", network)
    return True


def scrub(*, now: datetime, budget_s: float = SCRUB_S) -> dict[str, int]:
    """Check stored files for about ``budget_s`` seconds: damaged ones again, those without a sum, the rest. The next
    call continues; a file is checked again after :data:`CHECKED_EVERY`. Raises PlatformFault ``storage_failed``."""
    until, count = monotonic() + budget_s, {"checked": 0, "damaged": 0}
    for name in _turns(now):
        damage = _check(name, now)
        count["checked"] += 1
        if damage:
            count["damaged"] += 1
            logger.error("The stored file %s is %s.", name, damage)
        if monotonic() > until:
            break
    return count


def _turns(now: datetime) -> Iterator[str]:
    rechecked = Q(checked_at=None) | Q(checked_at__lt=now - timedelta(days=1))
    yield from list(StoredFile.objects.filter(~Q(damage=""), rechecked).values_list("name", flat=True)[:1000])
    for model, field in _columns():
        summed = StoredFile.objects.filter(name=OuterRef(field))
        new = model._base_manager.exclude(**{field: ""}).exclude(Exists(summed)).values_list(field, flat=True)
        yield from (name for name in new.iterator(chunk_size=200) if not name.startswith(UNSUMMED))
    due = Q(checked_at=None) | Q(checked_at__lt=now - CHECKED_EVERY)
    yield from (
        StoredFile.objects.filter(due, damage="")
        .order_by(F("checked_at").asc(nulls_first=True))
        .values_list("name", flat=True)
        .iterator(chunk_size=200)
    )


def _check(name: str, now: datetime) -> str:
    """Check a file and write down what was found; the damage, or ``""``."""
    known = StoredFile.objects.filter(name=name).first()
    try:
        with _at_storage(name), default_storage.open(name, "rb") as file:
            sha256, size = _summed(file)
    except FileNotFoundError:
        return _found(name, Damage.MISSING, now)
    if known is None or not known.sha256:
        if not _makes_sense(name):
            return _found(name, Damage.ALTERED, now)
        _note(name, sha256, size, now)
    elif sha256 != known.sha256:
        return _found(name, Damage.ALTERED, now)
    else:
        StoredFile.objects.filter(name=name).update(checked_at=now, damage="", damaged_at=None)
    return ""


def _is_away(name: str) -> bool:
    """Of a file that is not there: whether its whole folder is not, as that of a disk that is not mounted."""
    if not isinstance(default_storage, FileSystemStorage):  # it is somewhere else, and has answered
        return False
    return not Path(default_storage.path(name)).parent.is_dir()


def _makes_sense(name: str) -> bool:
    """Of a file that was stored before there were sums: whether it is what it must be, as far as it tells itself."""
    with default_storage.open(name, "rb") as file:
        content = file.read()
    try:
        if name.endswith(".gz"):
            return bool(content) and gzip.decompress(content) is not None
        network = Network.objects.filter(onnx=name).first()
        model = network.models.first() if network else None
        if network and model:
            metadata = parse_metadata(json.dumps(model.metadata).encode(), DEFAULT_LIMITS)
            return identity(content, metadata) == network.sha256
    except (OSError, EOFError, zlib.error, UserFault):
        return False
    return bool(content)


def _found(name: str, damage: Damage, now: datetime) -> str:
    """Record damage, unless nothing names the file any more."""
    if not any(model._base_manager.filter(**{field: name}).exists() for model, field in _columns()):
        StoredFile.objects.filter(name=name).delete()
        return ""
    with transaction.atomic():
        row, _ = StoredFile.objects.get_or_create(
            name=name, defaults={"sha256": "", "size": 0, "damage": damage, "damaged_at": now, "checked_at": now}
        )
        row.damage, row.damaged_at, row.checked_at = damage, row.damaged_at or now, now
        row.save(update_fields=["damage", "damaged_at", "checked_at"])
    return damage


def _damaged(name: str, damage: Damage) -> PlatformFault:
    try:
        if _found(name, damage, timezone.now()):
            logger.error("The stored file %s is %s.", name, damage)
    except Exception:  # the reader gets file_damaged in any case
        logger.exception("That the file %s is damaged cannot be written down.", name)
    fault = PlatformFault("file_damaged")
    fault.add_note(f"{name}: {damage}")
    return fault


def _note(name: str, sha256: str, size: int, checked_at: datetime | None = None) -> None:
    row = StoredFile(name=name, sha256=sha256, size=size, checked_at=checked_at)
    noted = ["sha256", "size", "checked_at", "damage", "damaged_at"]
    StoredFile.objects.bulk_create([row], update_conflicts=True, unique_fields=["name"], update_fields=noted)


def _columns() -> list[tuple[type[Model], str]]:
    return [
        (model, field.name)
        for model in apps.get_models()
        for field in model._meta.concrete_fields
        if isinstance(field, FileField) and not model._meta.proxy
    ]
