"""Holds: workers that an operator has paused or drained claim no job, whatever wakes them."""

from collections.abc import Iterable
from datetime import datetime

from django.db.models import Exists, Q

from .models import WorkerHold


def hold_workers(*, workers: Iterable[str], mode: WorkerHold.Mode, now: datetime) -> None:
    """Let these workers claim no more. What they run goes on; a drained one ends after that. Resume them with
    :func:`resume_workers`."""
    holds = [WorkerHold(worker=name, mode=mode, since=now) for name in sorted(set(workers))]
    WorkerHold.objects.bulk_create(
        holds, update_conflicts=True, unique_fields=["worker"], update_fields=["mode", "since"]
    )


def resume_workers(*, workers: Iterable[str]) -> int:
    """Let these workers claim again. Returns how many were held."""
    return WorkerHold.objects.filter(worker__in=list(workers)).delete()[0]


def holds_by_worker() -> dict[str, WorkerHold]:
    return {hold.worker: hold for hold in WorkerHold.objects.all()}


def hold_of(worker: str) -> str:
    """The mode in which a worker is held, or ``""``."""
    return WorkerHold.objects.filter(worker=worker).values_list("mode", flat=True).first() or ""


def not_held(worker: str) -> Q:
    """A condition for the statement that claims: nobody has held this worker."""
    return ~Q(Exists(WorkerHold.objects.filter(worker=worker)))
