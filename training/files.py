"""A training's files in the field's own formats, so that its tools read them: metrics, sim-traces, and all in one zip.

deepracer-simapp 6 (metrics/s3_metrics.py, training metrics of version 2.0) and the layout that deepracer-utils reads.
"""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from typing import Any

from .models import BestMetric, TrainingIteration, TrainingJob

_METRIC_NAMES = {BestMetric.PROGRESS: "progress", BestMetric.REWARD: "reward", BestMetric.LAP_TIME: "laptime"}


def training_metrics(job: TrainingJob) -> dict[str, Any]:
    """``{"metrics": [...], "version": 2.0, "best_model_metric": ...}``: an entry for each training episode and for each
    trial of an evaluation, in the order in which they were driven; times in simulated milliseconds.

    Many cars drive at once here, so ``start_time`` is the sum of what was driven before: no two episodes overlap.
    """
    metrics: list[dict[str, Any]] = []
    clock = episode = 0
    for iteration in job.iterations.order_by("number").defer("simtrace"):
        for phase, driven in (("training", iteration.episodes), ("evaluation", iteration.eval_trials)):
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
                    }
                )
                clock += one["time_ms"]
                episode += phase == "training"
    return {"metrics": metrics, "version": 2.0, "best_model_metric": _METRIC_NAMES[BestMetric(job.best_metric)]}


def simtrace(iteration: TrainingIteration) -> bytes:
    """The sim-trace of an iteration as CSV; ``b""`` where there is none (any more)."""
    if not iteration.simtrace:
        return b""
    with iteration.simtrace.open("rb") as file:
        return gzip.decompress(file.read())


def logs_zip(job: TrainingJob) -> bytes:
    """Everything that was written down: metrics, the newest sim-traces, the log, and what the training was made of.
    Names are those of the console, as deepracer-utils looks for them."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("metrics/training/training-metrics.json", json.dumps(training_metrics(job)))
        archive.writestr(f"logs/training/{job.name}-robomaker.log", job.log)
        archive.writestr("reward_function.py", job.reward_code)
        archive.writestr("model_metadata.json", json.dumps(job.metadata, indent=1))
        archive.writestr("hyperparameters.json", json.dumps(job.hyperparameters, indent=1))
        for iteration in job.iterations.exclude(simtrace="").order_by("number"):
            name = f"sim-trace/training/training-simtrace/{iteration.number - 1}-iteration.csv"
            archive.writestr(name, simtrace(iteration))
    return file.getvalue()
