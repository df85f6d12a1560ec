"""The queue of chunks of reports (:mod:`core.jobs`). Writes of a chunk that change its report lock the chunk first."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable
from datetime import datetime
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet

from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.kinds import register
from core.jobs.retried import RetriedKind
from core.jobs.work import never, run_next
from paddock.rules.race import RaceRules

from ..models import Result, State
from ..models.reports import UNDER_WAY, CarReport, ReportChunk, ReportLap
from ..running.queue.order import BACKGROUND, queued
from .grading import DrivenLap, digest_of, robustness_of

if TYPE_CHECKING:
    from paddock.simulator.randomisation import Variation

    from ..running.drives import DriveJob, DrivesOutcome

_RESULT = ("complete", "time_ms", "percent", "status", "x", "y", "trace_sha256")


class ReportChunks(RetriedKind[ReportChunk]):
    """Chunks run behind all other runs. The first chunks of all reports come before the second ones."""

    name, model, task, queue = "Report", ReportChunk, "evaluation.tasks.drive_reports", "celery"
    order, since = ("number", "pk"), "report__asked_at"
    related = ("report__model__network",)
    blank = {"progress": 0}
    wakes = 8
    alone = frozenset(("runner_died", "runner_error", "runner_protocol", "runner_timeout"))
    gave_up_code, lost_code = "platform_gave_up", "lease_expired"
    storage_counts = True

    def due(self, now: datetime) -> QuerySet[ReportChunk]:
        return self.free(now).filter(report__state__in=UNDER_WAY)

    def claim(self, *, worker: str, now: datetime) -> ReportChunk | None:
        if is_busy():
            return None
        return super().claim(worker=worker, now=now)

    def tidy(self, now: datetime) -> None:
        """Stop the remaining chunks of failed reports."""
        left = ReportChunk.objects.filter(state=State.QUEUED).exclude(report__state__in=UNDER_WAY)
        if left.exists():
            self.end(ReportChunk.objects.filter(pk__in=left, state=State.QUEUED), state=State.STOPPED, now=now)

    def began(self, job: ReportChunk, now: datetime) -> None:
        CarReport.objects.filter(pk=job.report_id, state=State.QUEUED).update(state=State.RUNNING, started_at=now)

    def others_passed(self, job: ReportChunk) -> bool:
        since = job.failed_at or job.report.asked_at
        mine = job.report.model.network_id
        runs = Result.objects.exclude(evaluation__model__network=mine).filter(evaluation__ended_at__gte=since)
        chunks = ReportChunk.objects.exclude(report__model__network=mine).filter(state=State.FINISHED)
        return runs.exists() or chunks.filter(ended_at__gte=since).exists()

    def gave_up(self, job: ReportChunk, now: datetime) -> None:
        ended = ReportChunk.objects.get(pk=job.pk)
        CarReport.objects.filter(pk=job.report_id, state__in=UNDER_WAY).update(
            state=State.FAILED, ended_at=now, reason_code=ended.reason_code, reason_params=ended.reason_params
        )

    def begin_anew(self, rows: QuerySet[ReportChunk], **columns: Any) -> bool:
        """With a chunk that failed its report begins anew, and what was not driven because of it."""
        reports = list(rows.values_list("report", flat=True))
        if not super().begin_anew(rows, **columns):
            return False
        failed = CarReport.objects.filter(pk__in=reports, state=State.FAILED)
        if failed.update(state=State.QUEUED, started_at=None, ended_at=None, reason_code="", reason_params={}):
            left = (State.FAILED, State.STOPPED)
            super().begin_anew(ReportChunk.objects.filter(report__in=reports, state__in=left))
        return True


CHUNKS = register(ReportChunks())


def is_busy() -> bool:
    """Whether an evaluation waits that is not a background one."""
    return queued().filter(not_before=None, priority__gt=BACKGROUND).exists()


def wake_if_due(now: datetime) -> None:
    """Wake a worker where chunks wait: for one who has just ended all evaluations."""
    if CHUNKS.due(now).exists():
        CHUNKS.wake()


def run_next_chunk(*, worker: str, interrupted: Callable[[], bool] = never) -> bool:
    """Drive the next chunk to its end. False: none waits, or evaluations go before it."""

    def run(chunk: ReportChunk, heartbeat: Heartbeat) -> bool:
        from ..running.drives import drive_all
        from ..running.queue.worker import note_inexact

        outcome = drive_all(
            job_of_chunk(chunk),
            on_progress=heartbeat.tell,
            should_stop=lambda: heartbeat.lost or interrupted(),
            wall_limit_s=settings.EVALUATION_WALL_SECONDS,
        )
        if outcome.inexact:
            note_inexact(chunk.report.model.network)
        assert chunk.lease is not None, "it was claimed"
        return finish_chunk(pk=chunk.pk, lease=chunk.lease, outcome=outcome, now=database_now())

    return run_next(CHUNKS, run, worker=worker, interrupted=interrupted)


def job_of_chunk(chunk: ReportChunk) -> DriveJob:
    """What the worker drives. Raises PlatformFault("storage_failed") or ("file_damaged") for the network's file."""
    from paddock.simulator.randomisation import variations

    from ..running.drives import DriveJob, LapDrive
    from ..running.race_setup import Venue
    from ..stored_files import read

    report = chunk.report
    laps = list(chunk.laps.select_related("track").order_by("number"))
    venues = {}
    varied: list[Variation] = []
    for lap in laps:
        key = lap.track_id, lap.direction
        if key not in venues:
            venues[key] = Venue(lap.track.geometry.in_direction(lap.direction), lap.direction, lap.track.look)
        if lap.variation is not None and not varied:
            varied = variations(report.seed, venues[key].track.length)
    return DriveJob(
        onnx=read(report.model.network.onnx.name or ""),
        metadata=report.model.metadata,
        facts=report.model.network.facts,
        drives=tuple(
            LapDrive(
                lap.number,
                venues[lap.track_id, lap.direction],
                None if lap.variation is None else varied[lap.variation],
            )
            for lap in laps
        ),
        rules=RaceRules.from_dict(report.rules),
    )


@transaction.atomic
def finish_chunk(*, pk: int, lease: uuid.UUID, outcome: DrivesOutcome, now: datetime) -> bool:
    """Write the laps of a chunk, once, and with the last chunk the report's figures. False: the lease is gone."""
    mine = CHUNKS.held(pk, lease)
    columns = {"engine": outcome.engine, "progress": len(outcome.drives), "reason_code": "", "reason_params": {}}
    if not CHUNKS.end(mine, state=State.FINISHED, now=now, **columns):
        return False
    chunk = ReportChunk.objects.get(pk=pk)
    by_number = {drive.number: drive for drive in outcome.drives}
    laps = list(chunk.laps.all())
    for lap in laps:
        for column in _RESULT:
            setattr(lap, column, getattr(by_number[lap.number], column))
    ReportLap.objects.bulk_update(laps, _RESULT)
    _end_report(chunk, now)
    return True


def _end_report(chunk: ReportChunk, now: datetime) -> None:
    """With the last chunk the report is done. What another engine has driven meanwhile is driven again."""
    report = CarReport.objects.select_for_update(of=("self",)).select_related("model").get(pk=chunk.report_id)
    chunks = ReportChunk.objects.filter(report=report)
    if report.state not in UNDER_WAY or chunks.exclude(state=State.FINISHED).exists():
        return
    others = list(chunks.exclude(engine=chunk.engine).values_list("pk", flat=True))
    if others:
        ReportLap.objects.filter(chunk__in=others).update(
            **dict.fromkeys(("complete", "time_ms", "percent", "x", "y")), status="", trace_sha256=""
        )
        for pk in others:
            CHUNKS.begin_anew(ReportChunk.objects.filter(pk=pk), engine="")
        return
    driven = driven_laps(report.laps.select_related("track").defer("track__npy").order_by("number"))
    robustness = robustness_of(driven)
    CarReport.objects.filter(pk=report.pk).update(
        state=State.FINISHED,
        ended_at=now,
        engine=chunk.engine,
        grade="" if robustness is None else robustness.grade,
        runs_sha256=digest_of(network=report.model.network_id, seed=report.seed, engine=chunk.engine, laps=driven),
    )


def driven_laps(laps: Iterable[ReportLap]) -> list[DrivenLap]:
    return [
        DrivenLap(
            number=lap.number,
            track=lap.track.fingerprint,
            direction=lap.direction,
            variation=lap.variation,
            complete=lap.complete,
            time_ms=lap.time_ms or 0,
            percent=lap.percent or 0.0,
            trace_sha256=lap.trace_sha256,
        )
        for lap in laps
        if lap.complete is not None
    ]
