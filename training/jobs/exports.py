"""A training's files as deepracer-utils reads them (deepracer-simapp 6, metrics/s3_metrics.py)."""

import gzip
import json
from collections.abc import Iterator
from typing import Literal

from django.http import HttpResponse, HttpResponseBase, StreamingHttpResponse

from accounts.models import Racer
from core.files.zip_stream import ZipPart, part_of, part_of_gzip, zipped
from evaluation.garage.downloads import as_download, download_of
from evaluation.garage.simulation_log import HYPERPARAMETERS, METADATA, settings_lines, trace_lines
from evaluation.stored_files import read, read_gzip
from paddock.errors import PlatformFault

from ..models import BestMetric, TrainingIteration, TrainingJob
from ..trainer.messages import EpisodeReport

VERSION = 2.0
# no type that a program opens by itself: a zip of stable-baselines3 holds pickles, and Python runs what they say
SB3_TYPE = "application/octet-stream"
AT_A_TIME = 50  # iterations that are held
_METRIC_NAMES = {BestMetric.PROGRESS: "progress", BestMetric.REWARD: "reward", BestMetric.LAP_TIME: "laptime"}


Download = Literal["best", "last", "sb3", "logs", "metrics", "trace"]


def download(job: TrainingJob, file: Download, reader: Racer) -> HttpResponseBase | None:
    """A file of the training for its owner and admins; None where there is none.

    ``best``, ``last``: a model as a package; ``sb3``: the model of stable-baselines3, with a warning in its name for
    readers who did not train it; ``trace``: the newest sim-trace. Raises PlatformFault ``storage_failed``,
    ``file_damaged``.
    """
    kind, name, data = "application/zip", f"{job.name}-logs.zip", logs_zip
    match file:
        case "best" | "last":
            model = job.best_model if file == "best" else job.last_model
            return None if model is None or model.deleted_at is not None else download_of(model)
        case "sb3":
            if not job.sb3_zip:
                return None
            warning = "" if job.owner_id == reader.pk else f"UNTRUSTED-{job.owner.alias}-"
            response = HttpResponse(read(job.sb3_zip.name or ""), content_type=SB3_TYPE)
            return as_download(response, f"{warning}{job.name}-sb3.zip")
        case "trace":
            newest = job.iterations.exclude(simtrace="").order_by("-number").first()
            if newest is None:
                return None
            response = HttpResponse(simtrace(newest), content_type="text/csv; charset=utf-8")
            return as_download(response, f"{job.name}-{newest.number}-sim-trace.csv")
        case "metrics":
            kind, name, data = "application/json", f"{job.name}-training-metrics.json", metrics_json
    return as_download(StreamingHttpResponse(data(job), content_type=kind), name)


def training_metrics(job: TrainingJob) -> dict[str, object]:
    """``{"metrics": [...], "version": 2.0, "best_model_metric": ...}``: all episodes and trials as driven, in simulated
    ms.

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


def _entries(job: TrainingJob) -> Iterator[list[dict[str, object]]]:
    """The entries of each iteration; those of a training with several tracks have ``track`` and ``direction``."""
    clock = episode = 0
    slugs = [track.slug for track in job.tracks]
    rows = job.iterations.order_by("number").values_list("episodes", "eval_trials")
    for driven_here in rows.iterator(chunk_size=AT_A_TIME):
        metrics: list[dict[str, object]] = []
        for phase, driven in zip(("training", "evaluation"), driven_here, strict=True):
            for trial, one in enumerate(driven, start=1):
                entry: dict[str, object] = {
                    "reward_score": round(one["reward"]),
                    "metric_time": clock + one["time_ms"],
                    "start_time": clock,
                    "elapsed_time_in_milliseconds": one["time_ms"],
                    "episode": episode,
                    "trial": trial,
                    "phase": phase,
                    "completion_percentage": int(one["progress"]),
                    "episode_status": one["status"],
                }
                if "track" in one:
                    entry["track"], entry["direction"] = _way_of(one, slugs)
                metrics.append(entry)
                clock += one["time_ms"]
                episode += phase == "training"
        yield metrics


def _way_of(driven: EpisodeReport, slugs: list[str]) -> tuple[str, str]:
    return slugs[min(driven["track"], len(slugs) - 1)], driven["direction"]


def _episodes_csv(job: TrainingJob) -> Iterator[bytes]:
    """Which track each episode of the sim-traces was on: their own columns are the field's."""
    yield b"iteration,episode,track,direction\n"
    slugs = [track.slug for track in job.tracks]
    for number, episodes in job.iterations.order_by("number").values_list("number", "episodes").iterator(AT_A_TIME):
        rows = ((number - 1, one.get("episode"), *_way_of(one, slugs)) for one in episodes if "track" in one)
        yield "".join(f"{iteration},{episode},{track},{way}\n" for iteration, episode, track, way in rows).encode()


def simtrace(iteration: TrainingIteration) -> bytes:
    """The sim-trace as CSV; ``b""`` without one. Raises PlatformFault ``storage_failed``, ``file_damaged``."""
    if not iteration.simtrace:
        return b""
    return read_gzip(iteration.simtrace.name or "")


def logs_zip(job: TrainingJob) -> Iterator[bytes]:
    """A zip of metrics, newest sim-traces, log and settings, laid out as the console's for deepracer-utils.

    Raises PlatformFault ``storage_failed`` at once if the storage is out; leaves a damaged trace out.
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
            if fault.code != "file_damaged":  # else purged meanwhile, or already reported to operators
                raise
            continue
        yield iteration.number, packed
