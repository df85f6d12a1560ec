"""A messenger with tasks for tests, and little patience. Run with ``celery --app tests.outages.busy_messenger worker``.

SIGUSR2 makes its main loop stand still.
"""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import django

from config.celery import app

django.setup()

from evaluation.running import heartbeat  # noqa: E402
from evaluation.running import worker_nodes as nodes  # noqa: E402

celery = app
FOLDER = Path(os.environ["MARKS"])
heartbeat.HUNG_AFTER_S, nodes.BEAT_EVERY_S = int(os.environ["HUNG_AFTER_S"]), 0.5
signal.signal(signal.SIGUSR2, lambda *_: threading.Event().wait())


@app.task(name="busy")
def busy(seconds: float = 1.0) -> None:
    """Take a while, so that a message is not acknowledged yet."""
    threading.Event().wait(seconds)


@app.task(name="mark")
def mark(name: str) -> None:
    """Leave a file."""
    (FOLDER / name).touch()
