"""Stores the reports of a running training under its lease."""

import io
import logging
import uuid
import zipfile
from contextlib import suppress
from datetime import datetime, timedelta

from django.conf import settings
from django.core.files.storage import default_storage
from django.db import transaction
from django.db.models import OuterRef, Subquery
from django.db.models.functions import Coalesce

from evaluation.models import StoredFile
from evaluation.stored_files import read, store

from ...models import Checkpoint, TrainingIteration, TrainingJob
from ...rewards.sandbox.call_limits import KEPT_CHARACTERS
from ...trainer.client import Iteration, SavedState
from ...trainer.messages import Prints
from .deletion import delete_stored, files_of_checkpoints
from .queue import TRAININGS

logger = logging.getLogger(__name__)
SIMTRACES_KEPT, SIMTRACE_BYTES_KEPT = 100, 32 * 1024 * 1024  # of a job; the newest
CHECKPOINTS_KEPT = 2
_LOG_LIMIT = 100_000
_MARK = " print: "  # behind the time: a line that the reward function has printed
_STAMP = len("2000-01-01 00:00:00")
_PREFIX = _STAMP + len(_MARK)
_NO_MORE = f"(the first {KEPT_CHARACTERS:,} characters are kept, and no more)"


def record_iteration(*, job: TrainingJob, lease: uuid.UUID, iteration: Iteration, now: datetime) -> bool:
    """Write one look at the car. False: the lease is gone. After a resume a number may come again: the newer counts."""
    values = iteration.values
    number = values["number"]
    name = ""
    if iteration.simtrace:
        path = f"training/{job.public_id}/{lease.hex[:8]}-{number}-iteration.csv.gz"
        try:
            name = store(path, iteration.simtrace)
        except Exception:  # whatever the storage raises: a training is worth more than a trace
            logger.exception("A sim-trace of training %s cannot be stored.", job.public_id)
    old: list[str] = []
    try:
        with transaction.atomic():
            mine = TRAININGS.held(job.pk, lease).update(
                steps_done=values["steps"], seconds_done=values["seconds"], driving=iteration.driving
            )
            if mine:
                replaced = TrainingIteration.objects.filter(job=job, number__gte=number)
                old += [one for one in replaced.values_list("simtrace", flat=True) if one]
                replaced.delete()
                if values["is_best"]:
                    TrainingIteration.objects.filter(job=job, is_best=True).update(is_best=False)
                TrainingIteration.objects.create(job=job, simtrace=name, **values)
                stale = TrainingIteration.objects.filter(pk__in=_stale(job))
                old += list(stale.values_list("simtrace", flat=True))
                stale.update(simtrace="")
    except BaseException:
        delete_stored([name])
        raise
    delete_stored(old if mine else [name])
    return bool(mine)


def _stale(job: TrainingJob) -> list[int]:
    """Iterations whose sim-trace is one too many, or weighs too much with those after it."""
    rows = TrainingIteration.objects.filter(job=job).exclude(simtrace="").order_by("-number")
    size = StoredFile.objects.filter(name=OuterRef("simtrace")).values("size")[:1]
    weighed = rows.annotate(size=Coalesce(Subquery(size), 0)).values_list("pk", "size")
    kept, stale = 0, []
    for place, (pk, weight) in enumerate(weighed):
        kept += weight
        if place >= SIMTRACES_KEPT or kept > SIMTRACE_BYTES_KEPT:
            stale.append(pk)
    return stale


def keep_checkpoint(
    *, job: TrainingJob, lease: uuid.UUID, saved: SavedState, networks: tuple[bytes, bytes], now: datetime
) -> bool:
    """Store a checkpoint with the best and the last network, and drop all but the one before. False: the lease is
    gone."""
    path = f"training/{job.public_id}/{lease.hex[:8]}-{saved.iteration}"
    names: list[str] = []
    old: list[str] = []
    try:
        names.append(store(f"{path}.checkpoint", saved.state))
        names.append(store(f"{path}.networks", _packed(networks)))
        with transaction.atomic():
            mine = TRAININGS.held(job.pk, lease).exists()
            if mine:
                again = Checkpoint.objects.filter(job=job, iteration__gte=saved.iteration)
                old += files_of_checkpoints(again)
                again.delete()
                Checkpoint.objects.create(
                    job=job,
                    iteration=saved.iteration,
                    steps=saved.steps,
                    seconds=saved.seconds,
                    file=names[0],
                    networks=names[1],
                    created_at=now,
                )
                kept = Checkpoint.objects.filter(job=job).order_by("-iteration").values_list("pk", flat=True)
                stale = Checkpoint.objects.filter(job=job).exclude(pk__in=list(kept[:CHECKPOINTS_KEPT]))
                old += files_of_checkpoints(stale)
                stale.delete()
    except BaseException:
        delete_stored(names)
        raise
    delete_stored(old if mine else names)
    return mine


def networks_of(checkpoint: Checkpoint) -> tuple[bytes, bytes]:
    """The best and the last network that :func:`keep_checkpoint` kept; ``b""`` each where there are none."""
    if not checkpoint.networks:
        return b"", b""
    with zipfile.ZipFile(io.BytesIO(read(checkpoint.networks.name or ""))) as archive:
        return archive.read("best"), archive.read("last")


def _packed(networks: tuple[bytes, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, network in zip(("best", "last"), networks, strict=True):
            archive.writestr(name, network)
    return file.getvalue()


def append_log(*, job_id: int, line: str, now: datetime) -> None:
    """Add a line to the log that the owner reads; at most 100,000 characters are kept, the first."""
    with transaction.atomic():
        log = TrainingJob.objects.filter(pk=job_id).values_list("log", flat=True).first()
        if log is not None and len(log) < _LOG_LIMIT:
            TrainingJob.objects.filter(pk=job_id).update(log=f"{log}{now:%Y-%m-%d %H:%M:%S} {line}\n")


def record_prints(*, job: TrainingJob, lease: uuid.UUID, prints: Prints, now: datetime) -> bool:
    """Store the reward function's output: the newest lines for the live page, and the first 16,000 characters in the
    log. False: the lease is gone."""
    with transaction.atomic():
        mine = TRAININGS.held(job.pk, lease).update(printed=prints.last)
        log = TRAININGS.held(job.pk, lease).values_list("log", flat=True).first() if mine else None
        if log is not None:
            added = _printed_lines(log, prints, now)
            if added and len(log) < _LOG_LIMIT:
                TRAININGS.held(job.pk, lease).update(log=log + added)
    return bool(mine)


def _printed_lines(log: str, prints: Prints, now: datetime) -> str:
    before = [line[_PREFIX:] for line in log.split("\n") if line[_STAMP:_PREFIX] == _MARK]
    if before and before[-1] == _NO_MORE:
        return ""
    room = KEPT_CHARACTERS - sum(len(line) + 1 for line in before)
    kept = prints.kept[: max(0, room)]
    lines = kept.removesuffix("\n").split("\n") if kept else []
    if prints.more or len(kept) < len(prints.kept):
        lines.append(_NO_MORE)
    return "".join(f"{now:%Y-%m-%d %H:%M:%S}{_MARK}{line}\n" for line in lines)


def purge_trainings(*, now: datetime) -> int:
    """Delete the sim-traces of trainings that ended ``TRAINING_TRACES_KEPT_DAYS`` ago, and files of killed workers.
    Returns the number of trainings."""
    cleared = 0
    before = now - timedelta(days=settings.TRAINING_TRACES_KEPT_DAYS)
    old = TrainingJob.objects.filter(ended_at__lt=before).exclude(iterations=None)
    for job in old.filter(iterations__simtrace__gt="").distinct().only("public_id", "sb3_zip"):
        traces = job.iterations.exclude(simtrace="")
        names = list(traces.values_list("simtrace", flat=True))
        traces.update(simtrace="")
        folder = f"training/{job.public_id}"
        with suppress(OSError):
            names += [f"{folder}/{name}" for name in default_storage.listdir(folder)[1]]
        delete_stored([name for name in names if name != job.sb3_zip.name])
        cleared += 1
    return cleared
