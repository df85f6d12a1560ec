"""A Celery worker whose evaluations stop at chosen points until it is killed.

Run with ``celery --app tests.evaluation.held_worker worker``. The folder in ``HOLD_DIR`` is the remote control: a file
``at`` names the point to stop at; whoever arrives there writes its process id to ``held``, once, and waits for ever,
at ``running`` until there is a file ``go``.
With ``REAL_RUNS`` in the environment the pipeline is the real one.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

import django

from config.celery import app

django.setup()

from celery.signals import worker_ready  # noqa: E402

from evaluation.running import pipeline, worker_nodes  # noqa: E402
from evaluation.running.queue import jobs  # noqa: E402
from evaluation.running.queue import worker as work  # noqa: E402
from evaluation.signals import evaluation_ended  # noqa: E402
from paddock.errors import UserFault  # noqa: E402
from tests.evaluation.stubs import car_outcome, outcome_of  # noqa: E402
from tests.proven import take_as_proven  # noqa: E402

celery = app
FOLDER = Path(os.environ["HOLD_DIR"])
worker_nodes.BEAT_EVERY_S = float(os.environ.get("BEAT_EVERY_S", worker_nodes.BEAT_EVERY_S))


def wanted(point: str) -> bool:
    """Whether to stop at ``point``; true once for each wish."""
    at = FOLDER / "at"
    if not at.exists() or at.read_text() != point:
        return False
    at.unlink()
    draft = FOLDER / "draft"
    draft.write_text(str(os.getpid()))
    draft.rename(FOLDER / "held")
    return True


def hold(point: str) -> None:
    if wanted(point):
        threading.Event().wait()


def before(point: str, function):
    def held(*args, **kwargs):
        hold(point)
        return function(*args, **kwargs)

    return held


def after(point: str, function):
    def held(*args, **kwargs):
        value = function(*args, **kwargs)
        hold(point)
        return value

    return held


def evaluate(job, on_progress=None, should_stop=lambda: False, wall_limit_s=0.0, pool=None):
    """A run that ends at once, unless it is held; then it can be stopped like a real one."""
    if pool is not None:
        pool.close()
    if wanted("running"):
        on_progress({"lap": 1})
        while not should_stop() and not (FOLDER / "go").exists():
            threading.Event().wait(0.05)
        if should_stop():
            raise UserFault("stopped")
    bots = [[[0.0, 0.0, 0.0]]] if job.rivals else []
    return outcome_of(salt=job.rules.seed, rivals=[car_outcome() for _ in job.rivals], layout={"bots": bots})


if "REAL_RUNS" not in os.environ:
    pipeline.evaluate = evaluate
    take_as_proven()
work.job_of = before("claimed", work.job_of)
jobs.store_files = after("stored", jobs.store_files)
work.finish_evaluation = after("committed", work.finish_evaluation)
evaluation_ended.connect(lambda **kwargs: hold("finishing"), weak=False)
worker_ready.connect(lambda **kwargs: (FOLDER / "ready").touch(), weak=False)
