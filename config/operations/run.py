"""Starts the programs of a site: as forks of one process that has loaded the code which they share."""

import ctypes
import gc
import os
import signal
import socket
import sys
import threading
import urllib.error
import urllib.request
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import NoReturn

from django.apps import apps
from django.conf import settings
from django.core.management.base import CommandError
from django.template import engines

from config.celery import app as celery_app
from config.operations.data_lock import hold_data
from config.operations.listen_address import browser_url
from config.serving import broker, web
from config.serving.forking import PYTHON, STOP_SIGNALS, become, end_with_parent
from config.serving.supervisor import Supervisor
from core import metrics
from core.database.known_migrations import known_migrations

VIDEO_WORKER_NICE = 10
# Celery advises against root; here only root can give each model another user id.
_QUIET = "You're running the worker with superuser privileges"
# What the programs load beside our own code
_OF_OTHERS = (
    *("celery.bin.celery", "celery.apps.worker", "celery.concurrency.prefork", "celery.concurrency.thread"),
    *("celery.worker.autoscale", "celery.worker.consumer", "celery.worker.loops", "celery.worker.strategy"),
    *("uvicorn.lifespan.off", "uvicorn.loops.uvloop"),
)
# What these packages load for features that the site does not use: DRF's browsable API and client, Celery's shell
_WITH_EXTRAS = ("rest_framework.compat", "rest_framework.test", "celery.bin.celery")
_EXTRAS = ("django.contrib.postgres.fields", "jinja2", "pygments", "requests")


class StopSignal(KeyboardInterrupt):
    """A signal arrived before the programs run."""

    def __init__(self, signum: int) -> None:
        super().__init__()
        self.status = 128 + signum


def stop_on_signals() -> None:
    for signum in STOP_SIGNALS:
        if signal.getsignal(signum) is not signal.SIG_IGN:  # as nohup leaves SIGHUP
            signal.signal(signum, _stop)


def run_site(host: str, port: int, prepare: Callable[[], None]) -> int:
    """Prepare the site in a process, run its programs until a signal, and return the exit status. Raises CommandError
    where the site cannot run."""
    os.umask(0o077)  # also of all that is started here
    lock = hold_data(settings.DATA_DIR / "run.lock")
    metrics.begin_anew()
    _listen(host, port).close()  # a port that is taken is refused before the preparation
    _load()
    _in_a_process(prepare)
    if settings.EMBEDDED_BROKER:
        _make_folders_of_broker()
    supervisor = Supervisor()
    for name, command in in_fewer_processes(programs(host, port)).items():
        if name == "web":
            web.add_processes(supervisor, _listen(host, port), shown_as=command)
        else:
            nice = VIDEO_WORKER_NICE if name == "video-worker" else 0
            supervisor.add(name, partial(become, command, nice), needed_to_the_end=name == "broker")
    import_module("config.wsgi")  # which looks for the static files that the preparation has collected
    _share()
    culprit, status = supervisor.run(beside=partial(_announce, browser_url(host, port)))
    lock.close()
    if culprit is not None:
        how = f"signal {-status}" if status < 0 else f"exit status {status}"
        raise CommandError(
            f"{culprit} cannot live ({how}), so everything was stopped. Its last lines above say why.",
            returncode=status if 0 < status < 128 else 1,
        )
    return status


def _stop(signum: int, frame: object) -> NoReturn:
    raise StopSignal(signum)


def in_fewer_processes(commands: dict[str, list[str]]) -> dict[str, list[str]]:
    """The same programs, with the scheduler as a thread of the messenger: a process takes 25 MB."""
    fewer = {name: command for name, command in commands.items() if name != "beat"}
    return fewer | {"messenger": [*commands["messenger"], "--with-scheduler"]}


def programs(host: str, port: int) -> dict[str, list[str]]:
    """The command of each program, by the name in front of its lines, as on several machines."""
    from league.webhooks.deliveries import AT_ONCE

    celery = [*PYTHON, "celery", "--quiet", "--app", "config"]

    def worker(pool: str, size: str, value: object, *others: str) -> list[str]:
        sized = ("--pool", pool, size, str(value))
        return [*celery, "worker", *sized, "--without-gossip", "--without-mingle", *others]

    found = {
        "web": [*PYTHON, "config.web", "--host", host, "--port", str(port)],
        "streams": [*PYTHON, "config.streams"],
        "worker": worker("threads", "--concurrency", settings.WORKER_CONCURRENCY),
    }
    if settings.TRAINING:
        own = ("--queues", "training", "--hostname", "trainer@%h")
        found["trainer"] = worker("prefork", "--autoscale", f"{settings.TRAINING_CONCURRENCY},0", *own)
    if settings.VIDEOS:  # a process for each video: an idle worker holds no libraries of pictures and video
        own = ("--queues", "videos", "--hostname", "video-worker@%h")
        found["video-worker"] = worker("prefork", "--autoscale", "1,0", "--max-tasks-per-child", "1", *own)
    # threads: it waits for other people's servers, and an idle one costs a single process
    own = ("--queues", "messages", "--hostname", "messenger@%h")
    found |= {"messenger": worker("threads", "--concurrency", AT_ONCE, *own), "beat": [*celery, "beat"]}
    if settings.METRICS_LISTEN is not None:
        found["metrics"] = [*PYTHON, "config.metrics"]
    if settings.EMBEDDED_BROKER:
        found = {"broker": broker.server_command(settings.VALKEY_DIR, settings.VALKEY_SOCKET), **found}
    return found


def _make_folders_of_broker() -> None:
    try:
        broker.make_private(settings.VALKEY_DIR)
        broker.make_private(settings.VALKEY_SOCKET.parent)
    except OSError as error:
        raise CommandError(f"The broker has no folder to work in: {error}.") from error


def _in_a_process(work: Callable[[], None]) -> None:
    """Do ``work`` in a fork, and end as it does when it fails, so that no connection that it opens reaches the
    programs."""
    ours = os.getpid()
    if (pid := os.fork()) == 0:
        for signum in STOP_SIGNALS:
            if signal.getsignal(signum) is _stop:
                signal.signal(signum, signal.SIG_DFL)
        end_with_parent(ours, signal.SIGKILL)
        gc.freeze()
        gc.enable()
        work()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)  # to give back 100 MB object by object would copy them first
    try:
        _, status = os.waitpid(pid, 0)
    except StopSignal:
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        raise
    if (ended := os.waitstatus_to_exitcode(status)) < 0:
        raise CommandError(
            f"The preparation was killed (signal {-ended}). The next start continues it.", returncode=128 - ended
        )
    if ended:
        sys.exit(ended)


def _load() -> None:
    """Load what the preparation and the programs share: they are forks, and loading takes time and memory in each."""
    os.environ["CELERY_SKIP_CHECKS"] = "1"  # the preparation runs them
    _load_without_extras()
    for module in ("config.urls", "config.serving.streams.server", *_OF_OTHERS):
        import_module(module)
    celery_app.loader.import_default_modules()
    celery_app.finalize()
    for model in apps.get_models(include_auto_created=True):
        str(model._base_manager.filter(pk__isnull=False).query)  # fills the caches of its fields and relations
    known_migrations()
    engines.all()  # with the libraries of their tags
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", _QUIET)


def _load_without_extras() -> None:
    """Load the packages that would load others for features which the site does not use: a quarter of a second."""
    missing: dict[str, ModuleType | None] = {name: None for name in _EXTRAS if name not in sys.modules}
    if "click_repl" not in sys.modules:
        missing["click_repl"] = shell = ModuleType("click_repl")  # Celery demands it for the shell of "celery amqp"
        shell.register_repl = id  # type: ignore[attr-defined]
    sys.modules.update(missing)  # type: ignore[arg-type]
    try:
        for module in _WITH_EXTRAS:
            import_module(module)
    finally:
        for name in missing:
            del sys.modules[name]


def _share() -> None:
    """Have the forks share all memory until they write to it."""
    gc.freeze()  # looking for garbage would write to what is shared; there is next to none
    gc.enable()
    if sys.platform == "linux":
        # The small gaps of the heap, 1 MB at most: a fork that uses them writes to a shared page for each. SQLite's
        # schema alone would cost every program 5 MB in place of 1 MB.
        malloc = ctypes.CDLL(None).malloc
        for size in range(1016, 8, -16):
            for _ in range(16_384 // size):
                malloc(size)


def _listen(host: str, port: int) -> socket.socket:
    try:
        return web.listen(host, port)
    except OSError as error:
        why = (error.strerror or str(error)).partition(" (while attempting")[0]  # as socket.create_server adds
        hint = f"--port {port + 1}" if port < 65535 else "--port 8000"
        raise CommandError(
            f"Paddock cannot listen on {host} port {port}: {why}. "
            f"Something else may be using it; try another, for example: make run PORT={port + 1} ({hint})."
        ) from None


def _announce(url: str) -> None:
    """Print the site's address once it answers."""
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
