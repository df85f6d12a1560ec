"""Workers that draw videos and crash at random: ``python -m tests.races.video_storm WORKERS``.

They draw until no video waits or is being drawn. Now and then one is killed, and another takes its place. All are forks
of one process, which waits for them and prints how each ended.
"""

from __future__ import annotations

import os
import random
import signal
import sys
from time import sleep

import django

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
django.setup()

from django.conf import settings  # noqa: E402
from django.utils import timezone  # noqa: E402

from core.wakeups import workers as wakeup  # noqa: E402
from tests.drawn_runs import a_drawing  # noqa: E402
from tests.storms import ride_out  # noqa: E402
from videos import drawing  # noqa: E402
from videos import services as videos  # noqa: E402
from videos.models import UNDER_WAY, Video  # noqa: E402
from videos.services import queue as jobs  # noqa: E402
from videos.services import worker as work  # noqa: E402

LEASE_S = 0.5
CRASH = 0.12
luck = random.Random()


def perhaps_die(where: str) -> None:
    if luck.random() < CRASH:
        print(f"crash {where}", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)


def draw(scene, out, *, on_progress, is_stopped):
    on_progress(0.5)
    perhaps_die("drawing")
    sleep(luck.random() * 0.02)
    return a_drawing(scene, out)


def store(*args, real=jobs.store):
    names = real(*args)
    perhaps_die("stored")
    return names


def worker() -> None:
    while Video.objects.filter(state__in=UNDER_WAY).exists():
        videos.VIDEOS.sweep(now=timezone.now(), wake=False)
        if not videos.run_next_video(worker=f"w{os.getpid()}"):
            sleep(0.05)


def main(workers: int) -> None:
    settings.LEASE_SECONDS = LEASE_S
    settings.EVALUATION_MAX_ATTEMPTS = 1000
    drawing.write_video, drawing.poster = draw, lambda scene: b"a still"
    jobs.store, wakeup.send = store, lambda *_, **__: None
    work.encoder_problem = str  # each fork would load PyAV
    ride_out(workers, worker, luck)


if __name__ == "__main__":
    main(int(sys.argv[1]))
