"""``manage.py run``: the site, a worker and everything they need, in the foreground."""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import threading
import urllib.error
import urllib.request
import warnings
from argparse import ArgumentParser
from collections.abc import Callable
from functools import partial
from importlib import import_module

from django.conf import settings
from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from config import broker, celery_app
from config.forking import PYTHON, end_with_parent
from config.management.data_lock import hold_data
from config.own_address import HOST, PORT, port, shown
from config.supervisor import Supervisor

VIDEO_WORKER_NICE = 10
# Celery advises against root; here root is what gives every model a user id of its own.
_QUIET = "You're running the worker with superuser privileges"
# What the programs of Celery load beside our own code
_OF_CELERY = ("celery.bin.celery", "celery.apps.worker", "celery.apps.beat", "celery.concurrency.prefork")


class Command(BaseCommand):
    """See the module's docstring."""

    help = "Run the site, a worker and the bundled broker in the foreground. Ctrl-C stops all of them."
    requires_system_checks = []  # the checks run once the database is there

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--host", default=HOST, help="address to listen on (default: this machine only)")
        parser.add_argument("--port", type=port, default=PORT, help="port to listen on (default 8000)")

    def handle(self, *, host: str, port: int, **options: object) -> None:
        try:
            self._run(host, port)
        except KeyboardInterrupt:
            self.stdout.write("Stopped.")
            sys.exit(130)

    def _run(self, host: str, port: int) -> None:
        os.umask(0o077)  # also of all that is started here
        lock = hold_data(settings.DATA_DIR / "run.lock")
        _refuse_taken_port(host, port)
        _in_a_process(self._prepare)
        supervisor = Supervisor()
        for name, command in _programs(host, port).items():
            nice = VIDEO_WORKER_NICE if name == "video-worker" else 0
            supervisor.add(name, command, nice=nice, needed_to_the_end=name == "broker", vital=name == "web")
        _load()
        culprit, status = supervisor.run(beside=partial(_announce, shown(host, port)))
        lock.close()
        if culprit is not None:
            how = f"signal {-status}" if status < 0 else f"exit status {status}"
            raise CommandError(
                f"{culprit} cannot live ({how}), so everything was stopped. Its last lines above say why.",
                returncode=status if 0 < status < 128 else 1,
            )
        self.stdout.write("Stopped.")
        sys.exit(status)

    def _prepare(self) -> None:
        """Bring database, static files and the catalogue up to date; the first time open the demo season."""
        from league.services import open_demo_season
        from tracks.services import load_catalogue

        self.stdout.write(f"Paddock keeps everything in {settings.DATA_DIR}")
        call_command("migrate", interactive=False, verbosity=0)
        self.check(fail_level=40)
        call_command("collectstatic", interactive=False, verbosity=0)
        load_catalogue()
        open_demo_season(now=timezone.now())


def _programs(host: str, port: int) -> dict[str, list[str]]:
    """What is to run, by the name that stands before its lines."""
    from league.services.deliveries import AT_ONCE

    celery = [*PYTHON, "celery", "--quiet", "--app", "config"]
    programs = {
        "web": [*PYTHON, "config.web", "--host", host, "--port", str(port)],
        "streams": [*PYTHON, "config.streams"],
        "worker": [
            *(*celery, "worker", "--pool", "prefork", "--concurrency", str(settings.WORKER_CONCURRENCY)),
            *("--without-gossip", "--without-mingle"),
        ],
        **_trainer(celery),
        **_video_worker(celery),
        # threads: it waits for other people's servers, and an idle one costs a single process
        "messenger": [
            *(*celery, "worker", "--pool", "threads", "--concurrency", str(AT_ONCE)),
            *("--without-gossip", "--without-mingle", "--queues", "messages", "--hostname", "messenger@%h"),
        ],
        "beat": [
            *(*celery, "beat", "--pidfile", ""),
            *("--schedule", str(settings.DATA_DIR / "celerybeat-schedule")),
        ],
    }
    if settings.EMBEDDED_BROKER:
        try:
            broker.make_private(settings.VALKEY_DIR)
            broker.make_private(settings.VALKEY_SOCKET.parent)
        except OSError as error:
            raise CommandError(f"The broker has no folder to work in: {error}.") from error
        programs = {"broker": broker.server_command(settings.VALKEY_DIR, settings.VALKEY_SOCKET), **programs}
    return programs


def _trainer(celery: list[str]) -> dict[str, list[str]]:
    """The worker for trainings, where they are installed: a process of its own, so that evaluations go on beside it."""
    if not settings.TRAINING:
        return {}
    return {
        "trainer": [
            *(*celery, "worker", "--pool", "prefork", "--concurrency", str(settings.TRAINING_CONCURRENCY)),
            *("--without-gossip", "--without-mingle", "--queues", "training", "--hostname", "trainer@%h"),
        ]
    }


def _video_worker(celery: list[str]) -> dict[str, list[str]]:
    """The worker for videos, which stands back for all others. Each video gets a process of its own, so that an idle
    worker holds no libraries of pictures and video."""
    if not settings.VIDEOS:
        return {}
    return {
        "video-worker": [
            *(*celery, "worker", "--pool", "prefork", "--concurrency", "1"),
            *("--without-gossip", "--without-mingle", "--max-tasks-per-child", "1"),
            *("--queues", "videos", "--hostname", "video-worker@%h"),
        ]
    }


def _in_a_process(work: Callable[[], None]) -> None:
    """Do ``work`` in a fork, and end as it does when it fails.

    So nothing that it opens, of database, broker or storage, goes on to the programs.
    """
    ours = os.getpid()
    if (pid := os.fork()) == 0:
        end_with_parent(ours, signal.SIGTERM)
        work()
        sys.exit()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the fork, and that is the end
    _, status = os.waitpid(pid, 0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if status:
        ended = os.waitstatus_to_exitcode(status)
        sys.exit(ended if ended > 0 else 128 - ended)


def _load() -> None:
    """Load what the programs share, so that they need not: they are forks."""
    for module in ("config.wsgi", "config.streams.server", *_OF_CELERY):
        import_module(module)
    celery_app.loader.import_default_modules()
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", _QUIET)
    gc.collect()
    gc.freeze()  # looking for garbage would write to what is shared


def _refuse_taken_port(host: str, port: int) -> None:
    try:
        address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        with socket.socket(address[0], socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address[4])
    except OSError as error:
        hint = f"--port {port + 1}" if port < 65535 else "--port 8000"
        raise CommandError(
            f"Paddock cannot listen on {host} port {port}: {error.strerror or error}. "
            f"Something else may be using it; try another, for example: make run PORT={port + 1} ({hint})."
        ) from None


def _announce(url: str) -> None:
    """Say where the site is once it answers."""
    while True:
        try:
            urllib.request.urlopen(f"{url}/health/live", timeout=5).close()
        except urllib.error.HTTPError:
            pass  # it answers
        except OSError:
            threading.Event().wait(0.2)
            continue
        print(f"Paddock is ready: {url}  (Ctrl-C stops it)")
        return
