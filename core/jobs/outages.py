"""The breaker: while the storage of files is out no job is claimed, and sweeps probe for its return.

Other rooms register checks for faults of parts that belong to one machine (:func:`look_after_faults`)."""

import logging
import uuid
from collections.abc import Callable
from datetime import datetime, timedelta

from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.db.models import F, Q

from paddock.errors import PaddockError, PlatformFault

from ..files.storage_faults import storage_at_work
from .models import Outage

logger = logging.getLogger(__name__)
STORAGE = Outage.Part.STORAGE.value
FIRST_LOOK, LONGEST = timedelta(seconds=5), timedelta(minutes=1)
_LOOKS: dict[str, Callable[[], object]] = {}


def is_out(*parts: str) -> bool:
    """Whether any of these parts was found to be out, and has not been seen since."""
    return bool(parts) and Outage.objects.filter(part__in=parts).exists()


def storage_is_out() -> bool:
    return is_out(STORAGE)


def waits_for_storage(fault: PaddockError) -> bool:
    """Whether a job failed only because the storage is out."""
    return fault.code == "storage_failed" and storage_is_out()


def look_after_faults(code: str, look: Callable[[], object]) -> None:
    """Call ``look`` after every platform fault with this code, before the job is requeued."""
    _LOOKS[code] = look


def note_fault(fault: PaddockError, *, now: datetime) -> None:
    """Open the breaker if needed before a job is requeued."""
    if fault.code == "storage_failed":
        note_storage_fault(now=now)
    elif fault.code in _LOOKS:
        _LOOKS[fault.code]()


def note_storage_fault(*, now: datetime) -> bool:
    """Probe the storage after a fault of a file, and open the breaker if it is out. Returns whether it is out."""
    if storage_is_out():
        return True
    if storage_answers():
        return False
    outage = Outage(part=STORAGE, since=now, look_at=now + FIRST_LOOK)
    Outage.objects.bulk_create([outage], ignore_conflicts=True)
    logger.error("The storage of files is out: nothing is claimed until it answers.")
    return True


def ended_outage(*parts: str, now: datetime) -> tuple[str, datetime] | None:
    """Probe a part when a probe is due, once for all callers. Returns the part and its outage's start if it is back."""
    due = Q(look_at__lte=now) | Q(look_at__gt=now + 2 * LONGEST)  # or the clock was set back
    outage = Outage.objects.filter(due, part__in=parts).first() if parts else None
    if outage is None:
        return None
    pause = min(FIRST_LOOK * 2 ** min(outage.looks, 10), LONGEST)
    mine, since = Outage.objects.filter(pk=outage.pk, looks=outage.looks), min(outage.since, now)
    if not mine.update(looks=F("looks") + 1, since=since, look_at=now + pause) or not storage_answers():
        return None
    Outage.objects.filter(pk=outage.pk).delete()
    logger.warning("The storage of files is back after %s s.", int((now - since).total_seconds()))
    return outage.part, since


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
