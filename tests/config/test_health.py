"""What ``/health/ready`` knows, each part by its name."""

from __future__ import annotations

import shutil
import sqlite3
import threading
from collections import namedtuple
from contextlib import closing
from datetime import timedelta
from threading import Event
from time import monotonic, time

import pytest
from django.conf import settings
from django.core.cache import cache
from django.core.files.storage import default_storage
from django.db import DatabaseError, connection
from django.db.migrations.recorder import MigrationRecorder
from django.test import override_settings
from django.utils import timezone
from redis import ConnectionError as NobodyThere

from config import tasks
from config.operations import health
from config.operations import health as pages
from config.operations.backup.databases import damage
from core.database import known_migrations as names
from core.database.known_migrations import known_migrations
from core.jobs.models import Outage
from evaluation.models import Evaluation, WorkerNode
from evaluation.running.queue.order import BACKGROUND
from evaluation.running.worker_nodes import order_workers, start_worker, stop_worker
from tests.evaluation.processes import wait_for
from tests.factories import a_model, a_racer, a_track

pytestmark = pytest.mark.django_db
PARTS = {"database", "writes", "pages", "migrations", "cache", "broker", "storage", "disk", "workers", "queue"}
PARTS |= {"messengers", "scheduler", "results"}


@pytest.fixture(autouse=True)
def everything_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is no broker and no cache of Valkey's in tests; and what was found before is not kept."""
    monkeypatch.setattr(health, "_broker", lambda: True)
    monkeypatch.setattr(health, "KEPT_S", -1.0)


@pytest.fixture
def waits():
    """Queue a run some minutes ago."""
    model = a_model(a_racer("ann"))

    def queue(minutes: float, priority: int = 0) -> Evaluation:
        return Evaluation.objects.create(
            **{"owner": model.owner, "model": model, "track": a_track(), "spec": {}, "priority": priority},
            queued_at=timezone.now() - timedelta(minutes=minutes),
        )

    return queue


def broken() -> set[str]:
    """The parts that are not as they should be."""
    return {name for name, good in health.look().parts.items() if not good}


def test_a_healthy_site_is_live_and_ready(client) -> None:
    assert client.get("/health/live").content == b"ok\n"
    ready = client.get("/health/ready")
    found = ready.json()
    assert found.pop("figures").keys() == {"disk_free_mb", "workers", "workers_held", "oldest_waits_s", "streams"}
    assert 0 <= found.pop("age_s") < 5
    assert (ready.status_code, found) == (200, dict.fromkeys(PARTS, True))


def test_a_missing_database_is_named(client, monkeypatch, caplog) -> None:
    def gone() -> bool:
        raise DatabaseError("gone")

    monkeypatch.setattr(health, "_database", gone)
    ready = client.get("/health/ready")
    assert (ready.status_code, ready.json()["database"], ready.json()["cache"]) == (503, False, True)
    assert "not ready: database" in caplog.text


def test_an_unresponsive_broker_is_named_quickly(monkeypatch) -> None:
    monkeypatch.undo()
    assert "broker" in broken()


def test_an_unresponsive_cache_is_named(monkeypatch) -> None:
    def gone(*arguments: object) -> None:
        raise NobodyThere("refused")

    monkeypatch.setattr(cache, "set", gone)
    assert broken() == {"cache"}


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif("postgresql" in settings.DATABASES["default"]["ENGINE"], reason="about SQLite's one writer")
def test_a_read_only_database_is_named(monkeypatch) -> None:
    monkeypatch.setattr(health, "WRITE_TIMEOUT_S", 0)
    name = connection.settings_dict["NAME"]
    if "memory" in str(name):
        pytest.skip("nobody else can lock a database in memory")
    with closing(sqlite3.connect(name, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        assert broken() == {"writes"}
        other.execute("ROLLBACK")
    assert broken() == set()


@pytest.mark.django_db(transaction=True)
def test_a_hanging_part_is_named_within_its_deadline_and_holds_one_thread(monkeypatch) -> None:
    goes_on = Event()
    monkeypatch.setattr(health, "storage_answers", lambda: goes_on.wait(20))
    assert broken() == {"storage"}
    threads = threading.active_count()
    for _ in range(3):
        began = monotonic()
        assert broken() == {"storage"} and monotonic() - began < health.BOUND_S
    assert threading.active_count() == threads
    goes_on.set()
    wait_for(lambda: broken() == set(), 10)


def test_a_request_whose_look_hangs_gets_no_old_answer(monkeypatch) -> None:
    monkeypatch.setattr(health, "_last", health.Readiness({"storage": True}, at=time() - 60))
    monkeypatch.setattr(health, "BOUND_S", 0.2)
    with health._asking:  # another request's
        found = health.readiness()
    assert set(found.parts) == PARTS and not any(found.parts.values())


def test_an_answer_tells_its_age(client, monkeypatch) -> None:
    monkeypatch.setattr(health, "KEPT_S", 60.0)
    monkeypatch.setattr(health, "_last", health.Readiness({"all": True}, at=time() - 40))
    ready = client.get("/health/ready")
    assert 40 <= ready.json()["age_s"] < 45 and 40 <= int(ready["Age"]) < 45


def test_an_answer_from_the_future_is_not_kept(monkeypatch) -> None:
    monkeypatch.setattr(health, "KEPT_S", 60.0)
    monkeypatch.setattr(health, "_last", health.Readiness({"all": True}, at=time() + 3600))
    assert set(health.readiness().parts) == PARTS


def test_web_processes_share_an_answer(monkeypatch) -> None:
    monkeypatch.setattr(health, "KEPT_S", 60.0)
    monkeypatch.setattr(health, "_last", None)
    monkeypatch.setattr(health, "look", lambda: health.Readiness({"mine": True}))
    (settings.DATA_DIR / "health.json").unlink(missing_ok=True)
    assert health.readiness().parts == {"mine": True}
    monkeypatch.setattr(health, "_last", None)  # another process
    monkeypatch.setattr(health, "look", lambda: pytest.fail("it looked again"))
    assert health.readiness().parts == {"mine": True}
    (settings.DATA_DIR / "health.json").write_text("{")
    monkeypatch.setattr(health, "_last", None)
    monkeypatch.setattr(health, "look", lambda: health.Readiness({"theirs": True}))
    assert health.readiness().parts == {"theirs": True}
    (settings.DATA_DIR / "health.json").unlink()


def test_a_damaged_database_page_is_named_until_repaired(monkeypatch, tmp_path) -> None:
    with closing(sqlite3.connect(tmp_path / "damaged")) as database:
        database.execute("CREATE TABLE cars AS SELECT 1 AS car")
        database.commit()
    content = bytearray((tmp_path / "damaged").read_bytes())
    content[4096:] = bytes(len(content) - 4096)
    (tmp_path / "damaged").write_bytes(content)
    with closing(sqlite3.connect(tmp_path / "damaged")) as damaged, monkeypatch.context() as patch:
        patch.setattr(pages, "damage", lambda whole: damage(damaged))
        assert not tasks.pages()
    assert broken() == {"pages"}
    assert tasks.pages()
    assert broken() == set()


def test_the_files_of_migrations_are_read_once_per_process(monkeypatch) -> None:
    known_migrations()
    monkeypatch.setattr(names, "iter_modules", lambda folder: pytest.fail("read again"))
    assert "migrations" not in broken()


def test_unapplied_migrations_are_named() -> None:
    MigrationRecorder.Migration.objects.filter(app="evaluation").last().delete()
    assert broken() == {"migrations"}


def test_an_unresponsive_storage_is_named(monkeypatch) -> None:
    def full(*arguments: object) -> str:
        raise OSError(28, "no space left on device")

    monkeypatch.setattr(default_storage, "save", full)
    assert broken() == {"storage"}


def test_the_storage_is_unhealthy_while_evaluations_are_paused(now) -> None:
    Outage.objects.create(part=Outage.Part.STORAGE, since=now, look_at=now + timedelta(seconds=5))
    assert broken() == {"storage"}


def test_a_nearly_full_disk_is_named(monkeypatch) -> None:
    free = namedtuple("usage", "total used free")(2**40, 2**40 - 2**29, 2**29)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: free)
    assert broken() == {"disk"} and health.look().figures["disk_free_mb"] == 512
    with override_settings(LOW_DISK_MB=500):
        assert broken() == set()


class TestWorkers:
    def start(self, **changes: object) -> None:
        start_worker(name="worker@here", queues=["celery"], processes=1)
        WorkerNode.objects.update(**changes) if changes else None

    def test_a_silent_worker_is_named_until_its_next_heartbeat(self) -> None:
        self.start(seen_at=timezone.now() - timedelta(minutes=2))
        assert broken() == {"workers"}
        self.start()
        assert broken() == set() and health.look().figures["workers"] == 1

    def test_a_worker_that_refuses_work_does_not_count(self) -> None:
        self.start(sandbox={"sufficient": False})
        assert broken() == {"workers"}

    def test_a_stopped_worker_is_missed_once_a_run_waits(self, waits) -> None:
        self.start(stopped_at=timezone.now())
        assert broken() == set()
        waits(minutes=2)
        assert broken() == {"workers"}

    @pytest.mark.parametrize("order", ["pause", "drain"])
    def test_a_held_worker_is_no_fault(self, waits, order) -> None:
        self.start(sandbox={"sufficient": False})
        order_workers(names=["all"], order=order, now=timezone.now())
        waits(minutes=2)
        assert broken() == set() and health.look().figures["workers_held"] == 1
        stop_worker(name="worker@here")
        assert broken() == set()
        order_workers(names=["all"], order="resume", now=timezone.now())
        assert broken() == {"workers"}


@pytest.mark.parametrize(("part", "queue"), [("messengers", "messages"), ("scheduler", "scheduler")])
class TestMessengersAndScheduler:
    def test_a_silent_program_is_named_until_its_next_heartbeat(self, part: str, queue: str) -> None:
        start_worker(name="one@here", queues=[queue], processes=1)
        assert broken() == set()
        WorkerNode.objects.update(seen_at=timezone.now() - timedelta(minutes=2))
        assert broken() == {part}
        start_worker(name="another@here", queues=[queue], processes=1)
        assert broken() == set(), "one of them is enough"

    def test_a_stopped_program_is_missed_while_others_are_up(self, part: str, queue: str) -> None:
        start_worker(name="one@here", queues=[queue], processes=1)
        WorkerNode.objects.update(stopped_at=timezone.now())
        start_worker(name="worker@here", queues=["videos", *({"messages", "scheduler"} - {queue})], processes=1)
        assert broken() == set(), "they may be starting together"
        WorkerNode.objects.update(started_at=timezone.now() - timedelta(minutes=2))
        assert broken() == {part}


class TestQueue:
    @pytest.fixture(autouse=True)
    def worker(self) -> None:
        start_worker(name="worker@here", queues=["celery"], processes=1)

    def test_a_run_that_waits_too_long_is_named(self, waits) -> None:
        waits(minutes=29)
        assert broken() == set()
        waits(minutes=31)
        assert broken() == {"queue"} and 1860 <= health.look().figures["oldest_waits_s"] < 1900

    def test_background_runs_may_wait(self, waits) -> None:
        waits(minutes=600, priority=BACKGROUND)
        assert broken() == set()


def test_repeated_requests_get_the_cached_answer(client, monkeypatch) -> None:
    monkeypatch.setattr(health, "KEPT_S", 60.0)
    monkeypatch.setattr(health, "_last", None)
    (settings.DATA_DIR / "health.json").unlink(missing_ok=True)
    looked = []
    monkeypatch.setattr(health, "look", lambda: looked.append(1) or health.Readiness({"all": True}))
    for _ in range(3):
        assert client.get("/health/ready").json()["all"] is True
    assert looked == [1]
