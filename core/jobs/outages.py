"""The breaker: while the storage of files is out nobody claims, so no job fails by it, and the sweeps look for its
return.

There is none for the broker, which nothing but the wake-up needs, and none in the database for the sandbox, which is
each machine's own: whoever knows what to look at after such a fault says so (:func:`look_after_faults`).
"""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable
from datetime import datetime, timedelta

from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.db.models import F

from paddock.errors import PaddockError, PlatformFault

from ..storage_faults import storage_at_work
from .models import Outage

logger = logging.getLogger(__name__)
STORAGE = Outage.Part.STORAGE.value
FIRST_LOOK, LONGEST = timedelta(seconds=5), timedelta(minutes=1)
_LOOKS: dict[str, Callable[[], object]] = {}


def is_out(*parts: str) -> bool:
    """Whether any of these parts was found to be out, and has not been seen since."""
    return bool(parts) and Outage.objects.filter(part__in=parts).exists()


def storage_is_out() -> bool:
    """:func:`is_out` of the storage of files."""
    return is_out(STORAGE)


def waits_for_storage(fault: PaddockError) -> bool:
    """Whether all that stops a job is that no file can be read or written: nothing is claimed meanwhile."""
    return fault.code == "storage_failed" and storage_is_out()


def look_after_faults(code: str, look: Callable[[], object]) -> None:
    """``look`` is called after every fault of ours with this code, before the job goes back into the queue."""
    _LOOKS[code] = look


def note_fault(fault: PaddockError, *, now: datetime) -> None:
    """Before a job goes back into the queue: nobody shall claim the next one only to fail like this one."""
    if fault.code == "storage_failed":
        note_storage_fault(now=now)
    elif fault.code in _LOOKS:
        _LOOKS[fault.code]()


def note_storage_fault(*, now: datetime) -> bool:
    """A stored file could not be read or written: see whether none can, and then open the breaker. Whether it is out.

    False means that only this file is lost or damaged, which is not a reason to keep others waiting.
    """
    if storage_is_out():
        return True
    if storage_answers():
        return False
    outage = Outage(part=STORAGE, since=now, look_at=now + FIRST_LOOK)
    Outage.objects.bulk_create([outage], ignore_conflicts=True)
    logger.error("The storage of files is out: nothing is claimed until it answers.")
    return True


def look_after(*parts: str, now: datetime) -> None:
    """Look whether a part that is out has come back, when a look is due; of many callers one looks. When it is back,
    what paused since it went is due at once."""
    from .kinds import all_kinds

    outage = Outage.objects.filter(part__in=parts, look_at__lte=now).first() if parts else None
    if outage is None:
        return
    pause = min(FIRST_LOOK * 2 ** min(outage.looks, 10), LONGEST)
    mine = Outage.objects.filter(pk=outage.pk, looks=outage.looks)
    if not mine.update(looks=F("looks") + 1, look_at=now + pause) or not storage_answers():
        return
    Outage.objects.filter(pk=outage.pk).delete()
    for kind in all_kinds():
        if outage.part in kind.needs:
            kind.end_pauses(since=outage.since)
    logger.warning("The storage of files is back after %s s.", int((now - outage.since).total_seconds()))


def storage_answers() -> bool:
    """Whether a small file can be written, is read as it was written, and can be deleted."""
    content = uuid.uuid4().hex.encode()
    try:
        with storage_at_work():
            name = default_storage.save(f"probe-{content.decode()}", ContentFile(content))
            try:
                with default_storage.open(name) as file:
                    return file.read() == content
            finally:
                default_storage.delete(name)
    except PlatformFault as fault:
        logger.warning("The storage of files does not answer: %s", fault.__cause__)
        return False
