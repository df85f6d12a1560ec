"""``/metrics``: who gets it, what is in it, and what it costs the database."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace

import pytest
from django.core.exceptions import ImproperlyConfigured
from django.db import DatabaseError, connection
from django.test.utils import CaptureQueriesContext
from prometheus_client.parser import text_string_to_metric_families

from config.operations import health, metrics
from config.operations.health import Readiness
from config.settings.env import env_listen, env_token
from core.events.models import Event
from core.events.reading import READERS, number_new
from core.jobs.kinds import all_kinds
from core.jobs.models import WorkerHold
from core.jobs.work import run_next
from core.metrics import DECLARED
from core.streams import life
from evaluation.garage import services
from evaluation.models import StoredFile, WorkerNode
from evaluation.running.queue import worker
from evaluation.running.queue.jobs import EVALUATIONS
from paddock.errors import PlatformFault, UserFault
from tests.core.jobs.kinds import MAKERS
from tests.factories import a_racer, lap, outcome

TOKEN = "a-token-of-the-tests"
MOST_QUERIES = 40
pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def on(settings, monkeypatch):
    settings.METRICS, settings.METRICS_TOKEN = True, TOKEN
    settings.MIDDLEWARE = ["config.middleware.request_metrics.RequestMetrics", *settings.MIDDLEWARE]
    monkeypatch.setattr(metrics, "readiness", lambda: Readiness({"database": True, "cache": False}))
    metrics._sums.cache_clear()


@pytest.fixture
def at(monkeypatch):
    """Make it this moment for a scrape."""
    return lambda moment: monkeypatch.setattr(metrics, "database_now", lambda: moment)


def scraped(client) -> dict[str, dict[tuple[tuple[str, str], ...], float]]:
    """Samples by name and labels."""
    found: dict[str, dict[tuple[tuple[str, str], ...], float]] = {}
    text = client.get("/metrics", headers={"Authorization": f"Bearer {TOKEN}"}).content.decode()
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found.setdefault(sample.name, {})[tuple(sorted(sample.labels.items()))] = sample.value
    return found


def value(client, name: str, **labels: str) -> float:
    return scraped(client).get(name, {}).get(tuple(sorted(labels.items())), 0.0)


class TestAccess:
    def test_without_a_token_for_it_there_is_no_such_page(self, client, settings):
        settings.METRICS_TOKEN = ""
        for sent in ("Bearer ", f"Bearer {TOKEN}", ""):
            assert client.get("/metrics", headers={"Authorization": sent}).status_code == 404

    @pytest.mark.parametrize("sent", ["", "Bearer", "Bearer ", f"Basic {TOKEN}", f"Bearer {TOKEN}x", "Bearer ï"])
    def test_another_token_is_refused(self, client, sent):
        answer = client.get("/metrics", headers={"Authorization": sent})
        assert (answer.status_code, answer["WWW-Authenticate"], answer.content) == (401, "Bearer", b"")

    def test_an_admin_without_the_token_is_refused(self, client, alice):
        alice.is_staff = alice.is_superuser = True
        alice.save()
        client.force_login(alice)
        assert client.get("/metrics").status_code == 401

    def test_with_the_token_it_is_the_format_of_prometheus_and_is_kept_nowhere(self, client):
        answer = client.get("/metrics", headers={"Authorization": f"Bearer {TOKEN}"})
        assert answer.status_code == 200 and answer["Content-Type"].startswith("text/plain; version=")
        assert "no-store" in answer["Cache-Control"]

    def test_a_post_is_refused(self, client):
        assert client.post("/metrics", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 405


class TestSettings:
    @pytest.mark.parametrize("text", ["127.0.0.1", "9464", ":9464", "127.0.0.1:0", "127.0.0.1:65536", "host:x"])
    def test_an_address_without_a_port_is_refused(self, monkeypatch, text):
        monkeypatch.setenv("PADDOCK_METRICS_LISTEN", text)
        with pytest.raises(ImproperlyConfigured, match=r"127\.0\.0\.1:9464"):
            env_listen("PADDOCK_METRICS_LISTEN")

    def test_an_address_of_ipv6_has_brackets(self, monkeypatch):
        monkeypatch.setenv("PADDOCK_METRICS_LISTEN", "[::1]:9464")
        assert env_listen("PADDOCK_METRICS_LISTEN") == ("::1", 9464)

    @pytest.mark.parametrize("text", ["short", "with a space inside", "sixteen-letters\n"])
    def test_a_weak_token_is_refused(self, monkeypatch, text):
        monkeypatch.setenv("PADDOCK_METRICS_TOKEN", text)
        with pytest.raises(ImproperlyConfigured, match="at least 16"):
            env_token("PADDOCK_METRICS_TOKEN")


class TestRequests:
    def test_a_request_counts_by_view_and_class_of_status(self, client):
        before = value(client, "paddock_request_seconds_count", view="about", status="2xx")
        client.get("/about/")
        assert value(client, "paddock_request_seconds_count", view="about", status="2xx") == before + 1

    def test_a_shared_page_from_memory_counts_by_its_view(self, client, monkeypatch):
        from config.middleware import shared_pages

        monkeypatch.setattr(shared_pages, "is_shared", lambda: True)
        before = value(client, "paddock_request_seconds_count", view="tracks", status="2xx")
        for _ in range(2):
            client.get("/tracks/")
        assert value(client, "paddock_request_seconds_count", view="tracks", status="2xx") == before + 2

    def test_paths_that_clients_make_up_are_one_label(self, client):
        before = value(client, "paddock_request_seconds_count", view="none", status="4xx")
        for number in range(3):
            client.get(f"/nowhere-{number}/")
        found = scraped(client)["paddock_request_seconds_count"]
        assert found[("status", "4xx"), ("view", "none")] == before + 3
        assert not any("nowhere" in str(labels) for labels in found)

    def test_a_scrape_counts_as_no_request(self, client):
        client.get("/metrics")
        assert not any(("view", "metrics") in labels for labels in scraped(client)["paddock_request_seconds_count"])


class TestJobs:
    @pytest.mark.parametrize(
        ("fault", "labels", "end"),
        [
            (UserFault("policy_late"), {"reason": "policy_late", "fault": "user", "then": "failed"}, "failed"),
            (PlatformFault("runner_died"), {"reason": "runner_died", "fault": "platform", "then": "retried"}, "failed"),
        ],
    )
    def test_a_fault_counts_by_its_code(self, client, alice, oval, now, fault, labels, end):
        def do(job, heartbeat):
            raise fault

        of_fault = {"kind": "evaluation", **labels}
        before = value(client, "paddock_job_faults_total", **of_fault)
        times = value(client, "paddock_job_seconds_count", kind="evaluation", end=end)
        MAKERS[EVALUATIONS](alice, oval, now)
        assert run_next(EVALUATIONS, do, worker="test")
        assert value(client, "paddock_job_faults_total", **of_fault) == before + 1
        assert value(client, "paddock_job_seconds_count", kind="evaluation", end=end) == times + 1

    def test_a_run_counts_its_time_by_part(self, client, alice, oval, now, monkeypatch):
        from evaluation.running import pipeline

        driven = replace(outcome([lap(1, 9000)]), shares={"physics": 1.5, "policy": 0.25})
        monkeypatch.setattr(pipeline, "evaluate", lambda job, **options: driven)
        monkeypatch.setattr(worker, "job_of", lambda evaluation: None)
        before = scraped(client).get("paddock_run_part_seconds_total", {})
        MAKERS[EVALUATIONS](alice, oval, now)
        assert worker.run_next_evaluation(worker="test")
        after = scraped(client)["paddock_run_part_seconds_total"]
        for part, seconds in driven.shares.items():
            key = (("part", part),)
            assert after[key] == pytest.approx(before.get(key, 0.0) + seconds)


class TestUploads:
    @pytest.mark.parametrize("fault", [UserFault("garage_full"), PlatformFault("conversion_failed")])
    def test_a_refused_upload_counts_by_its_reason(self, client, alice, monkeypatch, fault):
        def admit(*files, **options):
            raise fault

        monkeypatch.setattr(services, "admit", admit)
        before = value(client, "paddock_uploads_total", result=fault.code)
        with pytest.raises(type(fault)):
            services.admit_upload(owner=alice, files=[])
        assert value(client, "paddock_uploads_total", result=fault.code) == before + 1

    def test_an_accepted_upload_counts(self, client, alice, monkeypatch):
        before = value(client, "paddock_uploads_total", result="accepted")
        monkeypatch.setattr(services, "admit", lambda *files, **options: SimpleNamespace(sha256="0" * 64, onnx=b""))
        services.admit_upload(owner=alice, files=[])
        assert value(client, "paddock_uploads_total", result="accepted") == before + 1


class TestGauges:
    def test_a_queue_shows_its_jobs_and_the_age_of_the_oldest(self, client, alice, bob, oval, now, at):
        at(now + timedelta(seconds=90))
        MAKERS[EVALUATIONS](alice, oval, now)
        MAKERS[EVALUATIONS](bob, oval, now + timedelta(seconds=30))
        EVALUATIONS.claim(worker="worker@one", now=now + timedelta(seconds=80))
        found = scraped(client)
        jobs = found["paddock_queue_jobs"]
        states = {state: jobs[("kind", "evaluation"), ("state", state)] for state in ("waiting", "running", "paused")}
        assert states == {"waiting": 1, "running": 1, "paused": 0}
        assert found["paddock_queue_oldest_seconds"][(("kind", "evaluation"),)] == 60
        assert found["paddock_workers_busy"][(("kind", "evaluation"),)] == 1

    def test_every_kind_of_job_has_its_rows(self, client):
        kinds = {kind.name.lower() for kind in all_kinds()}
        found = scraped(client)
        assert {dict(labels)["kind"] for labels in found["paddock_queue_oldest_seconds"]} == kinds

    def test_workers_by_queue_and_state(self, client, now, at):
        at(now)
        WorkerNode.objects.create(name="a@one", seen_at=now, queues=["celery", "videos"])
        WorkerNode.objects.create(name="b@one", seen_at=now - timedelta(minutes=5), queues=["celery"])
        WorkerNode.objects.create(name="c@one", seen_at=now, stopped_at=now, queues=["celery"])
        for name, mode in (("d@one", "paused"), ("e@one", "drained")):
            WorkerNode.objects.create(name=name, seen_at=now, queues=["training"])
            WorkerHold.objects.create(worker=name, mode=mode, since=now)
        found = {key: count for key, count in scraped(client)["paddock_workers"].items() if count}
        assert found == {
            (("queue", "celery"), ("state", "alive")): 1,
            (("queue", "celery"), ("state", "silent")): 1,
            (("queue", "videos"), ("state", "alive")): 1,
            (("queue", "training"), ("state", "paused")): 1,
            (("queue", "training"), ("state", "draining")): 1,
        }

    def test_a_queue_without_a_worker_has_none_alive(self, client):
        found = scraped(client)["paddock_workers"]
        assert {dict(key)["queue"] for key in found} == {*(kind.queue for kind in all_kinds()), "scheduler"}
        assert set(found.values()) == {0}

    def test_the_lag_of_a_reader_begins_with_its_first_unread_event(self, client, now, at):
        reader = READERS["notices"]
        at(now + timedelta(seconds=50))
        for seconds in (0, 20):
            Event.objects.create(kind=reader.kinds[0].name, at=now, recorded_at=now + timedelta(seconds=seconds))
        number_new()
        Event.objects.create(kind=reader.kinds[0].name, at=now, recorded_at=now + timedelta(seconds=40))
        found = scraped(client)
        assert found["paddock_events_unread"][(("reader", "notices"),)] == 3
        assert found["paddock_events_lag_seconds"][(("reader", "notices"),)] == 50

    def test_stored_bytes_by_kind(self, client):
        for name, size in (("traces/a", 3), ("traces/b", 4), ("networks/c", 5)):
            StoredFile.objects.create(name=name, size=size, sha256="0" * 64)
        found = scraped(client)["paddock_stored_bytes"]
        assert (found[(("kind", "traces"),)], found[(("kind", "networks"),)]) == (7, 5)

    def test_streams_and_parts(self, client):
        life.report({"streams": 12})
        found = scraped(client)
        assert found["paddock_streams_open"][()] == 12
        assert found["paddock_part_works"] == {(("part", "database"),): 1, (("part", "cache"),): 0}

    def test_no_label_names_a_racer(self, client, oval, now):
        """Each label is one of a known set, whatever racers are called."""
        racer = a_racer("unmistakable")
        MAKERS[EVALUATIONS](racer, oval, now)
        client.force_login(racer)
        client.get(f"/racers/{racer.alias}/")
        assert "unmistakable" not in str(scraped(client))

    def test_all_that_a_scrape_has_is_declared(self, client):
        names = {re.sub(r"_(bucket|sum|count)$", "", name) for name in scraped(client)}
        assert names <= set(DECLARED)
        assert {name for name, metric in DECLARED.items() if metric.type == "gauge"} <= names


class TestCost:
    def test_the_queries_of_a_scrape_do_not_grow_with_the_rows(self, client, oval, now):
        def queries() -> int:
            metrics._sums.cache_clear()
            with CaptureQueriesContext(connection) as asked:
                scraped(client)
            return len(asked)

        empty = queries()
        for make in 2 * [*MAKERS.values()]:
            make(a_racer(), oval, now)
        assert queries() == empty <= MOST_QUERIES

    def test_without_the_database_there_are_counts_and_parts(self, client, monkeypatch):
        monkeypatch.setattr(metrics, "readiness", lambda: Readiness({"database": False}))
        client.get("/about/")
        found = scraped(client)
        assert found["paddock_part_works"] == {(("part", "database"),): 0}
        assert found["paddock_request_seconds_count"] and "paddock_queue_jobs" not in found

    def test_a_database_that_ends_during_a_scrape_spoils_nothing_else(self, client, monkeypatch):
        def gone(kind, now):
            raise DatabaseError

        monkeypatch.setattr(metrics, "backlog", gone)
        found = scraped(client)
        assert found["paddock_disk_free_bytes"] and "paddock_queue_jobs" not in found

    def test_the_parts_are_those_of_the_health_page(self, client, monkeypatch):
        monkeypatch.undo()
        monkeypatch.setattr(health, "_last", None)  # of the test before
        monkeypatch.setattr(health, "_look_in_turn", health.look)
        assert {check.name for check in health.checks() if check.name} == set(metrics.readiness().parts)
