"""What ``/health/ready`` knows, each part by its name."""

from __future__ import annotations

import shutil
import sqlite3
from collections import namedtuple
from contextlib import closing
from datetime import timedelta
from threading import Thread

import pytest
from django.conf import settings
from django.core.cache import cache
from django.core.files.storage import default_storage
from django.db import DatabaseError, connection
from django.db.migrations.recorder import MigrationRecorder
from django.test import override_settings
from django.utils import timezone
from redis import ConnectionError as NobodyThere

from config import health, pages, tasks
from config.backup.databases import damage
from core.jobs.models import Outage
from evaluation.models import Evaluation, WorkerNode
from evaluation.queue_order import BACKGROUND
from evaluation.services.nodes import start_worker
from tests.factories import a_model, a_racer, a_track

pytestmark = pytest.mark.django_db
PARTS = {"database", "writes", "pages", "migrations", "cache", "broker", "storage", "disk", "workers", "queue"}


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
    assert found.pop("figures").keys() == {"disk_free_mb", "workers", "oldest_waits_s", "streams"}
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


def test_a_slow_part_delays_only_one_request(monkeypatch) -> None:
    asked: list[health.Readiness] = []
    before = health.Readiness({"storage": True})

    def drips() -> health.Readiness:
        others = [Thread(target=lambda: asked.append(health.readiness()), daemon=True) for _ in range(3)]
        for other in others:
            other.start()
        for other in others:
            other.join(2)
        return health.Readiness({"storage": False})

    monkeypatch.setattr(health, "_last", (0.0, before))
    monkeypatch.setattr(health, "look", drips)
    assert not health.readiness().is_ready
    assert asked == [before] * 3


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
    looked = []
    monkeypatch.setattr(health, "look", lambda: looked.append(1) or health.Readiness({"all": True}))
    for _ in range(3):
        assert client.get("/health/ready").json()["all"] is True
    assert looked == [1]
