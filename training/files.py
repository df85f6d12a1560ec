"""A training's files in the field's own formats, so that its tools read them: metrics, sim-traces, and all in one zip.

deepracer-simapp 6 (metrics/s3_metrics.py, training metrics of version 2.0) and the layout that deepracer-utils reads.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from core.archive import ZipPart, part_of, part_of_gzip, zipped
from evaluation.robomaker import HYPERPARAMETERS, METADATA, settings_lines, trace_lines
from evaluation.services.stored import read, read_gzip
from paddock.errors import PlatformFault

from .models import BestMetric, TrainingIteration, TrainingJob

if TYPE_CHECKING:
    from accounts.models import Racer

VERSION = 2.0
# no type that a program opens by itself: a zip of stable-baselines3 holds pickles, and Python runs what they say
SB3_TYPE = "application/octet-stream"
AT_A_TIME = 50  # iterations that are held
_METRIC_NAMES = {BestMetric.PROGRESS: "progress", BestMetric.REWARD: "reward", BestMetric.LAP_TIME: "laptime"}


def sb3_name(job: TrainingJob, reader: Racer) -> str:
    """What the zip of stable-baselines3 is called; for whoever did not train it themselves, with a warning."""
    return f"{job.name}-sb3.zip" if job.owner_id == reader.pk else f"UNTRUSTED-{job.owner.alias}-{job.name}-sb3.zip"


def training_metrics(job: TrainingJob) -> dict[str, Any]:
    """``{"metrics": [...], "version": 2.0, "best_model_metric": ...}``: an entry for each training episode and for each
    trial of an evaluation, in the order in which they were driven; times in simulated milliseconds.

    Many cars drive at once here, so ``start_time`` is the sum of what was driven before: no two episodes overlap.
    """
    return {
        "metrics": [entry for entries in _entries(job) for entry in entries],
        "version": VERSION,
        "best_model_metric": _METRIC_NAMES[BestMetric(job.best_metric)],
    }


def metrics_json(job: TrainingJob) -> Iterator[bytes]:
    """:func:`training_metrics` as JSON, an iteration at a time: a long training has a hundred thousand episodes."""
    before = b'{"metrics": ['
    for entries in _entries(job):
        if entries:
            yield before + json.dumps(entries)[1:-1].encode()
            before = b",\n"
    if before != b",\n":
        yield before
    best = json.dumps(_METRIC_NAMES[BestMetric(job.best_metric)])
    yield f'], "version": {VERSION}, "best_model_metric": {best}}}\n'.encode()


def _entries(job: TrainingJob) -> Iterator[list[dict[str, Any]]]:
    clock = episode = 0
    slugs = [track.slug for track in job.tracks]
    rows = job.iterations.order_by("number").values_list("episodes", "eval_trials")
    for driven_here in rows.iterator(chunk_size=AT_A_TIME):
        metrics: list[dict[str, Any]] = []
        for phase, driven in zip(("training", "evaluation"), driven_here, strict=True):
            for trial, one in enumerate(driven, start=1):
                metrics.append(
                    {
                        "reward_score": round(one["reward"]),
                        "metric_time": clock + one["time_ms"],
                        "start_time": clock,
                        "elapsed_time_in_milliseconds": one["time_ms"],
                        "episode": episode,
                        "trial": trial,
                        "phase": phase,
                        "completion_percentage": int(one["progress"]),
                        "episode_status": one["status"],
                        **_way_of(one, slugs),
                    }
                )
                clock += one["time_ms"]
                episode += phase == "training"
        yield metrics


def _way_of(driven: dict[str, Any], slugs: list[str]) -> dict[str, str]:
    """Track and direction of an episode, of a training that has several."""
    if "track" not in driven:
        return {}
    return {"track": slugs[min(driven["track"], len(slugs) - 1)], "direction": driven["direction"]}


def _episodes_csv(job: TrainingJob) -> Iterator[bytes]:
    """Which track each episode of the sim-traces was on: their own columns are the field's."""
    yield b"iteration,episode,track,direction\n"
    slugs = [track.slug for track in job.tracks]
    for number, episodes in job.iterations.order_by("number").values_list("number", "episodes").iterator(AT_A_TIME):
        rows = ((one.get("episode"), _way_of(one, slugs)) for one in episodes if "track" in one)
        yield "".join(f"{number - 1},{episode},{way['track']},{way['direction']}\n" for episode, way in rows).encode()


def simtrace(iteration: TrainingIteration) -> bytes:
    """The sim-trace of an iteration as CSV; ``b""`` where there is none (any more).

    Raises PlatformFault ``storage_failed``, ``file_damaged``."""
    if not iteration.simtrace:
        return b""
    return read_gzip(iteration.simtrace.name or "")


def newest_simtrace(job: TrainingJob) -> tuple[int, bytes] | None:
    """The number of the last iteration that has a sim-trace, and the trace as CSV; None where there is none."""
    newest = job.iterations.exclude(simtrace="").order_by("-number").first()
    return None if newest is None else (newest.number, simtrace(newest))


def sb3_of(job: TrainingJob) -> bytes | None:
    """The model as stable-baselines3 saves it; None where there is none."""
    if not job.sb3_zip:
        return None
    return read(job.sb3_zip.name or "")


def logs_zip(job: TrainingJob) -> Iterator[bytes]:
    """Everything that was written down, as a zip in pieces: metrics, the newest sim-traces, the log, and what the
    training was made of. Laid out as the console's, so that deepracer-utils reads the unpacked folder.

    Raises PlatformFault ``storage_failed`` at once where no trace can be had now; one that is damaged is left out.
    """
    next(_traces(job), None)
    return zipped(_parts(job))


def _parts(job: TrainingJob) -> Iterator[ZipPart]:
    yield part_of("metrics/training/training-metrics.json", metrics_json(job))
    yield part_of("reward_function.py", [job.reward_code.encode()])
    yield part_of(METADATA, [json.dumps(job.metadata, indent=1).encode()])
    yield part_of(HYPERPARAMETERS, [json.dumps(job.hyperparameters, indent=1).encode()])
    if job.alternate_direction or job.more_tracks.exists():
        yield part_of("sim-trace/training/episodes.csv", _episodes_csv(job))
    for number, packed in _traces(job):
        yield part_of_gzip(f"sim-trace/training/training-simtrace/{number - 1}-iteration.csv", packed)
    yield part_of(f"logs/training/{job.name}-robomaker.log", _log(job))


def _log(job: TrainingJob) -> Iterator[bytes]:
    """The log as the console's: what was set, what the training said, every step of the sim-traces that are kept."""
    yield settings_lines(job.track.slug, job.hyperparameters, job.metadata)
    yield job.log.encode()
    if job.log and not job.log.endswith("\n"):
        yield b"\n"
    yield from trace_lines(gzip.decompress(packed) for _, packed in _traces(job))


def _traces(job: TrainingJob) -> Iterator[tuple[int, bytes]]:
    """Number and gzip of each iteration's sim-trace that is kept, one at a time."""
    for iteration in job.iterations.exclude(simtrace="").order_by("number").only("number", "simtrace", "job_id"):
        try:
            packed = read(iteration.simtrace.name or "")
        except PlatformFault as fault:
            if fault.code != "file_damaged":  # else cleared away in this very moment, or operators are told
                raise
            continue
        yield iteration.number, packed
