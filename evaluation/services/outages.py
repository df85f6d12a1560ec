"""The breaker: while the storage of files is out nobody claims, so no car fails by it, and the sweep looks for its
return.

There is none for the broker, which nothing but the bell needs, and none in the database for the sandbox, which is each
machine's own: a worker whose wall is gone stops by itself (:func:`evaluation.services.nodes.note_worker`).
"""

from __future__ import annotations

import logging
import uuid
from datetime import datetime, timedelta

from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.db.models import F

from core.storage_faults import storage_at_work
from paddock.errors import PlatformFault

from ..models import Evaluation, Outage, State

logger = logging.getLogger(__name__)
STORAGE = Outage.Part.STORAGE
FIRST_LOOK, LONGEST = timedelta(seconds=5), timedelta(minutes=1)


def storage_is_out() -> bool:
    """Whether the storage was found to be away, and has not been seen since."""
    return Outage.objects.filter(part=STORAGE).exists()


def note_storage_fault(*, now: datetime) -> bool:
    """A stored file could not be read or written: see whether none can, and then open the breaker. Whether it is out.

    False means that only this file is lost or damaged, which is no reason to keep others waiting.
    """
    if storage_is_out():
        return True
    if storage_answers():
        return False
    outage = Outage(part=STORAGE, since=now, look_at=now + FIRST_LOOK)
    Outage.objects.bulk_create([outage], ignore_conflicts=True)
    logger.error("The storage of files is out: nothing is claimed until it answers.")
    return True


def look_after_storage(*, now: datetime) -> bool:
    """Look whether a storage that is out has come back, when a look is due; of many callers one looks. True: it is
    back, and what paused since it went is due at once."""
    outage = Outage.objects.filter(part=STORAGE, look_at__lte=now).first()
    if outage is None:
        return False
    pause = min(FIRST_LOOK * 2 ** min(outage.looks, 10), LONGEST)
    mine = Outage.objects.filter(pk=outage.pk, looks=outage.looks)
    if not mine.update(looks=F("looks") + 1, look_at=now + pause) or not storage_answers():
        return False
    Outage.objects.filter(pk=outage.pk).delete()
    Evaluation.objects.filter(state=State.QUEUED, failed_at__gte=outage.since).update(not_before=None)
    logger.warning("The storage of files is back after %s s.", int((now - outage.since).total_seconds()))
    return True


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
