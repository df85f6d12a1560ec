"""A messenger outlives its broker, or ends so that it is started again; its list is bounded while nobody reads it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from celery import Celery
from redis import Redis

import config.celery  # noqa: F401 — every program has its transport
from config.serving import broker, broker_transport
from evaluation.running import heartbeat
from tests import servers
from tests.config.test_run import rows
from tests.evaluation.processes import suspended, wait_for
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.slow, pytest.mark.django_db]  # programs get a copy of the database of the tests
QUEUE = "messages"


class Place:
    """A data folder, and a Valkey server that comes and goes."""

    def __init__(self, data: Path, folder: Path) -> None:
        self.data, self.folder, self.path = data, folder, broker.socket_path(folder)
        self.url = broker.broker_url(self.path)
        self.app = Celery(broker=self.url, set_as_current=False)
        self.server = Redis(unix_socket_path=str(self.path))
        self.log = data.parent / "program.log"

    @contextmanager
    def valkey(self) -> Iterator[subprocess.Popen]:
        with servers.running(
            broker.server_command(self.folder, self.path), lambda: servers.answers(self.path)
        ) as process:
            yield process
            process.kill()
            process.wait()

    @contextmanager
    def program(self, *arguments: str, app: str = "config", **more: str) -> Iterator[subprocess.Popen]:
        environment = {
            **os.environ,
            "PADDOCK_DATA": str(self.data),
            "DJANGO_SETTINGS_MODULE": "config.settings",
            "CELERY_BROKER_URL": self.url,
            "CACHE_URL": broker.cache_url(self.path),
            "MARKS": str(self.data.parent),
            **more,
        }
        with self.log.open("ab") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", "celery", "--app", app, *arguments],
                **{"cwd": CHECKOUT, "env": environment, "stdout": output, "stderr": subprocess.STDOUT},
            )
        try:
            yield process
        finally:
            process.kill()
            process.wait()

    @contextmanager
    def messenger(self, hung_after_s: int = 20) -> Iterator[subprocess.Popen]:
        options = ("--pool", "threads", "--concurrency", "8", "--queues", QUEUE, "--hostname", "messenger@here")
        patience = {"HUNG_AFTER_S": str(hung_after_s)}
        with self.program("worker", *options, app="tests.outages.busy_messenger", **patience) as process:
            self.reaches("up")
            yield process

    def send(self, task: str, *arguments: str | float) -> None:
        self.app.send_task(task, arguments, queue=QUEUE, retry=False)

    def reaches(self, mark: str) -> None:
        """Wait until the messenger has done a task."""
        self.send("mark", mark)
        wait_for((self.data.parent / mark).exists, 60, self.log)

    def row(self, name: str) -> tuple | None:
        query = f"select stopped_at is null, queues from evaluation_workernode where name like '{name}@%'"
        return next(iter(rows(self.data, query)), None)


@pytest.fixture
def place(tmp_path: Path, new_data: Callable[..., Path]) -> Iterator[Place]:
    with servers.short_folder() as folder:
        yield Place(new_data(tmp_path / "data"), folder)


def test_a_busy_messenger_outlives_killed_brokers(place: Place) -> None:
    with ExitStack() as stack:
        server = stack.enter_context(place.valkey())
        messenger = stack.enter_context(place.messenger())
        for number, pause_s in enumerate((0.0, 0.2, 1.5, 3.0, 0.0, 1.0, 0.0, 0.1)):
            for _ in range(3 if number % 2 else 24):  # some threads are free and wait for more, or none is
                place.send("busy", 1.5 if number % 2 else 0.4)
            wait_for(lambda: place.server.hlen("unacked") >= 3, 20, place.log)
            server.kill()
            server.wait()
            with pytest.raises(subprocess.TimeoutExpired):
                messenger.wait(pause_s)
            server = stack.enter_context(place.valkey())
            place.reaches(f"after-{number}")
            assert messenger.poll() is None
        with suspended(server.pid), pytest.raises(subprocess.TimeoutExpired):
            messenger.wait(12)
        place.reaches("after-a-pause")
    assert "Unrecoverable" not in place.log.read_text()


def test_a_messenger_that_stands_still_is_ended(place: Place) -> None:
    with place.valkey(), place.messenger(hung_after_s=6) as messenger:
        messenger.send_signal(signal.SIGUSR2)
        assert messenger.wait(60) == -signal.SIGALRM


def test_an_idle_messenger_goes_on_and_one_that_takes_nothing_ends(place: Place) -> None:
    with place.valkey(), place.messenger() as messenger:
        with pytest.raises(subprocess.TimeoutExpired):
            messenger.wait(4)  # twice as long as one that takes nothing has
        place.app.control.cancel_consumer(QUEUE)
        wait_for(lambda: place.send("busy") or place.server.llen(QUEUE) > 3, 30, place.log)
        assert messenger.wait(60) == 1
        assert place.row("messenger")[0], "it did not stop in good order"


def test_the_scheduler_has_a_heartbeat(place: Place) -> None:
    with place.valkey(), place.program("beat", "--schedule", str(place.data / "schedule"), "--pidfile", "") as beat:
        wait_for(lambda: place.row("scheduler") == (1, '["scheduler"]'), 60, place.log)
        wait_for(lambda: place.server.llen(QUEUE) > 0, 20, place.log)
        beat.send_signal(signal.SIGTERM)
        assert beat.wait(30) == 0, place.log.read_text()
        assert place.row("scheduler")[0] == 0


def test_a_messenger_is_the_scheduler_too(place: Place) -> None:
    options = ("--pool", "threads", "--concurrency", "8", "--queues", QUEUE, "--hostname", "messenger@here")
    with place.valkey(), place.program("worker", *options, "--with-scheduler") as messenger:
        wait_for(lambda: place.row("scheduler") == (1, '["scheduler"]'), 60, place.log)
        wait_for(lambda: place.row("messenger") == (1, '["messages"]'), 60, place.log)
        wait_for(lambda: place.server.llen("celery") > 0, 20, place.log)
        messenger.send_signal(signal.SIGTERM)
        assert messenger.wait(30) == 0, place.log.read_text()
        assert (place.row("scheduler")[0], place.row("messenger")[0]) == (0, 0)


def test_the_row_of_an_autoscaled_worker_has_its_largest_number_of_processes(place: Place) -> None:
    options = ("--pool", "prefork", "--autoscale", "7,0", "--queues", "videos", "--hostname", "video-worker@here")
    with place.valkey(), place.program("worker", *options):
        wait_for(lambda: place.row("video-worker") == (1, '["videos"]'), 60, place.log)
        assert rows(place.data, "select processes from evaluation_workernode") == [(7,)]


def test_a_messenger_whose_scheduler_stands_still_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The messenger's own loop turns all the while."""
    alarms: list[int] = []
    now = [0.0]
    monkeypatch.setattr(heartbeat, "monotonic", lambda: now[0])
    monkeypatch.setattr(heartbeat, "_turned", {})
    monkeypatch.setattr(heartbeat.signal, "alarm", alarms.append)
    heartbeat._watch(heartbeat.NAME)
    for now[0] in (15.0, 60.0, 119.5):
        heartbeat._watch("messenger@here")
    assert alarms == [120, 105, 60, 1]
    heartbeat._watch(heartbeat.NAME)
    assert alarms[-1] == 120
    heartbeat._stop_watching(heartbeat.NAME)
    heartbeat._stop_watching("messenger@here")
    assert alarms[-1] == 0


@pytest.mark.parametrize("queue", ["messages", "celery", "training", "videos"])
def test_a_list_that_nobody_reads_keeps_the_newest(place: Place, queue: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker_transport, "LONGEST", 20)
    with place.valkey():
        for number in range(50):
            place.app.send_task("mark", [str(number)], queue=queue, retry=False)
        kept = place.server.lrange(queue, 0, -1)
        assert len(kept) == 20
        assert b'"argsrepr": "[\'49\']"' in kept[0] and b'"argsrepr": "[\'30\']"' in kept[-1]


def test_every_message_of_the_scheduler_expires_at_the_broker(settings) -> None:
    for entry in settings.CELERY_BEAT_SCHEDULE.values():
        assert entry["options"]["expiration"] == entry["options"]["expires"]
