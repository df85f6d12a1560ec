"""Records events."""

from collections.abc import Iterable
from datetime import datetime
from typing import Any

from django.db import transaction

from ..wakeups.streams import ring_after_commit
from .kinds import COLUMNS, KINDS, EventKind
from .models import Event
from .waking import wake_readers

BATCH = 500


def written(
    kind: EventKind,
    *,
    at: datetime,
    racer: int | None = None,
    race: int | None = None,
    subject: str = "",
    once: str = "",
    **data: Any,
) -> Event:
    """An event for :func:`record_all`, not saved yet; arguments as of :func:`record`."""
    if KINDS.get(kind.name) != kind:
        raise TypeError(f"{kind.name} is not a registered kind of event")
    named = {"racer": racer is not None, "race": race is not None, "subject": bool(subject)}
    if [name for name in COLUMNS if named[name]] != [name for name in COLUMNS if name in kind.names]:
        raise TypeError(f"{kind.name} names {', '.join(kind.names) or 'nothing'}")
    if set(data) != set(kind.data):
        raise TypeError(f"{kind.name} keeps {', '.join(kind.data) or 'nothing'}, not {', '.join(data) or 'nothing'}")
    if bool(once) != bool(kind.once):
        raise TypeError(f"{kind.name} happens {'once for ' + kind.once if kind.once else 'any number of times'}")
    return Event(kind=kind.name, at=at, racer_id=racer, race=race, subject=subject, once=once or None, data=data)


def record(kind: EventKind, *, at: datetime, **what: Any) -> bool:
    """Record an event in the caller's transaction; its readers wake after the commit. Returns whether it is new.

    ``what``: the columns and all of the data that the kind names, and ``once``. Raises TypeError for anything missing
    or unknown."""
    return record_all([written(kind, at=at, **what)]) == 1


def record_all(events: Iterable[Event]) -> int:
    """:func:`record` for many events. Returns the number of new ones."""
    rows = list(events)
    with transaction.atomic():
        known = _known(rows)
        new = [row for row in rows if not row.once or (row.kind, row.once) not in known]
        # somebody else may be writing the same at this moment: theirs stands
        Event.objects.bulk_create(new, batch_size=BATCH, ignore_conflicts=True)
        if new:
            ring_after_commit()
            wake_readers({row.kind for row in new})
    return len(new)


def _known(rows: list[Event]) -> set[tuple[str, str]]:
    once = [row.once for row in rows if row.once]
    if not once:
        return set()
    known = Event.objects.filter(kind__in={row.kind for row in rows}, once__in=once)
    return {(kind, once) for kind, once in known.values_list("kind", "once") if once}
