"""A worker without Celery that drives reports until none is left: ``python -m tests.evaluation.report_worker [LAPS]``.

With a number it kills itself at once when so many laps of a chunk are driven.
"""

from __future__ import annotations

import os
import signal
import sys
import threading

import django

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
django.setup()

from django.conf import settings  # noqa: E402

from core.database.clock import database_now  # noqa: E402
from core.wakeups import workers as wakeup  # noqa: E402
from evaluation.models.reports import UNDER_WAY, CarReport  # noqa: E402
from evaluation.reports.jobs import CHUNKS, ReportChunks, run_next_chunk  # noqa: E402
from evaluation.running import drives  # noqa: E402

really = drives.drive_all


def drive_until(laps: int):
    def drive_all(job, on_progress, *args, **kwargs):
        def tell(done: int) -> None:
            on_progress(done)
            if done >= laps:
                os.kill(os.getpid(), signal.SIGKILL)

        return really(job, tell, *args, **kwargs)

    return drive_all


def main() -> None:
    settings.LEASE_SECONDS = 2.0
    ReportChunks.beat_s = 0.1
    wakeup.send = lambda *_, **__: None
    if sys.argv[1:]:
        drives.drive_all = drive_until(int(sys.argv[1]))
    while CarReport.objects.filter(state__in=UNDER_WAY).exists():
        CHUNKS.sweep(now=database_now(), wake=False)
        if not run_next_chunk(worker=f"w{os.getpid()}"):
            threading.Event().wait(0.1)


main()
