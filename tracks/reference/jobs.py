"""The queue of reference laps (:mod:`core.jobs`): driven when no other car waits, in a process at lowest priority."""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
import uuid
from collections.abc import Callable
from datetime import datetime
from typing import TYPE_CHECKING

from django.conf import settings

from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.kinds import all_kinds, register
from core.jobs.retried import RetriedKind
from core.jobs.work import StopCheck, never, run_next
from paddock.errors import PlatformFault, UserFault
from paddock.simulator.engine import ENGINE_ID

from ..models import ReferenceLap, ReferenceState, Track
from .selectors import demanded

if TYPE_CHECKING:
    from .process import DrivenReference

_LOOK_S = 0.5  # how long a car that was submitted meanwhile waits at most
_MODULE = "tracks.reference.process"


class ReferenceLaps(RetriedKind[ReferenceLap]):
    """Reference laps run when no other job of the same workers is due, and make way for one."""

    name, model, task, queue = "Reference", ReferenceLap, "tracks.tasks.drive_references", "celery"
    order, since = ("queued_at", "pk"), "queued_at"
    related = ("track",)
    alone = frozenset(("reference_failed",))
    gave_up_code, lost_code = "reference_failed", "reference_lost"

    def claim(self, *, worker: str, now: datetime) -> ReferenceLap | None:
        return None if self.is_busy(now) else super().claim(worker=worker, now=now)

    def is_busy(self, now: datetime) -> bool:
        """Whether another job waits for a worker that drives reference laps."""
        others = (kind for kind in all_kinds() if kind.queue == self.queue and kind is not self)
        return any(kind.due(now).exists() for kind in others)

    def tidy(self, now: datetime) -> None:
        """Queue what rooms above ask for."""
        queue_references(now=now)

    def others_passed(self, job: ReferenceLap) -> bool:
        since = job.failed_at or job.queued_at
        return ReferenceLap.objects.filter(state=ReferenceState.FINISHED, ended_at__gte=since).exists()


REFERENCES = register(ReferenceLaps())


def queue_references(*, now: datetime) -> int:
    """Queue the reference laps that rooms above ask for and that were never queued on this engine. Returns how many."""
    known = set(ReferenceLap.objects.filter(engine=ENGINE_ID).values_list("track_id", "direction").order_by())
    missing = sorted(demanded() - known)
    with_shape = set(Track.objects.exclude(length_m=None).values_list("pk", flat=True).order_by()) if missing else set()
    rows = [
        ReferenceLap(track_id=track, direction=direction, engine=ENGINE_ID, queued_at=now)
        for track, direction in missing
        if track in with_shape
    ]
    ReferenceLap.objects.bulk_create(rows, ignore_conflicts=True)  # another scheduler may be at it
    return len(rows)


def run_next_reference(*, worker: str, interrupted: StopCheck = never) -> bool:
    """Drive the next reference lap to its end. False: none waits, or other jobs go before it."""
    made_way = False

    def makes_way() -> bool:
        nonlocal made_way
        made_way = made_way or interrupted() or REFERENCES.is_busy(database_now())
        return made_way

    def run(job: ReferenceLap, heartbeat: Heartbeat) -> bool:
        found = drive(job.track, job.direction, lambda: heartbeat.lost or makes_way())
        return finish_reference(job=job, found=found, now=database_now())

    return run_next(REFERENCES, run, worker=worker, interrupted=lambda: made_way or interrupted())


def finish_reference(*, job: ReferenceLap, found: DrivenReference, now: datetime) -> bool:
    """Write the lap, once. False: the lease is gone."""
    assert isinstance(job.lease, uuid.UUID), "it was claimed"
    return REFERENCES.end(
        REFERENCES.held(job.pk, job.lease),
        state=ReferenceState.FINISHED,
        now=now,
        reason_code="",
        reason_params={},
        time_ms=found["time_ms"],
        laps=found["laps"],
        trace=gzip.compress(found["trace"].encode(), mtime=0),
        trace_sha256=found["trace_sha256"],
    )


def drive(track: Track, direction: str, should_stop: Callable[[], bool]) -> DrivenReference:
    """The answer of :data:`_MODULE`, a process that loads the simulator in place of this one. Raises UserFault
    "reference_undrivable", PlatformFault "reference_failed" also where it was stopped."""
    process = subprocess.Popen(
        [sys.executable, "-m", _MODULE],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=settings.BASE_DIR,
        env={"PATH": os.environ.get("PATH", ""), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        text=True,
    )
    asked: str | None = json.dumps({"track": track.geometry.to_dict(), "direction": direction})
    try:
        while True:
            try:
                answer, notes = process.communicate(asked, timeout=_LOOK_S)
                break
            except subprocess.TimeoutExpired:
                asked = None
                if should_stop():
                    raise PlatformFault("reference_failed") from None
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    if process.returncode:
        fault = PlatformFault("reference_failed")
        fault.add_note(f"Exit status {process.returncode}. {notes[-2000:]}")
        raise fault
    found: DrivenReference | None = json.loads(answer)
    if found is None:
        raise UserFault("reference_undrivable")
    return found
