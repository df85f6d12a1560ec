"""The operators' page: workers that live and that died, what each does, the queues, and running again what failed."""

from __future__ import annotations

import re
import uuid
from datetime import timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.db.models.functions import Now
from django.test import Client
from django.utils import timezone

from config.operations.workers import queues_at, workers_at
from core.database.clock import database_now
from evaluation.models import Evaluation, State, WorkerNode
from evaluation.running.proof import Proof
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.worker_nodes import (
    BEAT_EVERY_S,
    FORGOTTEN_AFTER,
    SILENT_AFTER,
    beat_worker,
    order_workers,
    start_worker,
    stop_worker,
)
from paddock.rules.race import RaceRules
from races.entries.services.submissions import submit_model
from races.models import Entry
from tests.drawn_runs import a_driven_run
from tests.factories import a_model, a_race, a_racer, a_track
from tests.training.jobs import a_training
from training.models import JobState, TrainingJob
from videos.models import Video, VideoState

pytestmark = pytest.mark.django_db
MINUTE = timedelta(minutes=1)


@pytest.fixture(autouse=True)
def every_wake(wakes: list[dict]) -> list[dict]:
    """No broker."""
    return wakes


@pytest.fixture
def client() -> Client:
    client = Client()
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    client.force_login(boss, backend="django.contrib.auth.backends.ModelBackend")
    return client


@pytest.fixture
def now():
    return database_now()


def states(now) -> dict[str, str]:
    return {one.node.name: one.state for one in workers_at(now)}


def row(html: str, name: str) -> str:
    """The words of a row of the page."""
    found = re.search(rf'<tr data-(?:worker|queue)="{re.escape(name)}">(.*?)</tr>', html, re.S)
    return " ".join(re.sub(r"<[^>]+>", " ", found[1]).split())


def fail(rows, code: str, now, worker: str = "w@one") -> None:
    rows.update(state="failed", reason_code=code, ended_at=now, worker=worker)


# --- heartbeats ----------------------------------------------------------------------------------------------------


def test_a_worker_is_alive_while_it_sends_heartbeats(now):
    start_worker(name="w@one", queues=["celery"], processes=2, now=now)
    assert states(now + SILENT_AFTER) == {"w@one": "alive"}
    assert states(now + SILENT_AFTER + MINUTE) == {"w@one": "silent"}
    assert beat_worker(name="w@one", now=now + SILENT_AFTER)
    assert states(now + SILENT_AFTER + MINUTE) == {"w@one": "alive"}
    assert timedelta(seconds=2 * BEAT_EVERY_S) < SILENT_AFTER, "one beat may be late"


def test_a_stopped_worker_is_not_lost_and_can_return(now):
    start_worker(name="w@one", queues=["celery"], processes=1, now=now)
    stop_worker(name="w@one", now=now)
    assert states(now + 5 * MINUTE) == {"w@one": "stopped"}
    start_worker(name="w@one", queues=["celery", "videos"], processes=1, now=now + 5 * MINUTE)
    assert states(now + 5 * MINUTE) == {"w@one": "alive"}
    assert WorkerNode.objects.get().queues == ["celery", "videos"]


def test_a_starting_worker_removes_forgotten_rows(now):
    start_worker(name="old@one", queues=[], processes=1, now=now - FORGOTTEN_AFTER - MINUTE)
    start_worker(name="new@one", queues=[], processes=1, now=now)
    assert states(now) == {"new@one": "alive"}
    assert not beat_worker(name="old@one", now=now), "it has to start again"


def test_a_heartbeat_is_one_statement_with_database_time(django_assert_num_queries):
    start_worker(name="w@one", queues=[], processes=1)
    WorkerNode.objects.update(seen_at=timezone.now() - timedelta(hours=5))
    with django_assert_num_queries(1) as queries:
        beat_worker(name="w@one")
    assert "UPDATE" in queries[0]["sql"].upper()
    assert WorkerNode.objects.filter(seen_at__gte=Now() - MINUTE, seen_at__lte=Now()).exists()
    assert states(database_now()) == {"w@one": "alive"}


# --- the page ------------------------------------------------------------------------------------------------------


def test_the_page_shows_live_workers_their_jobs_and_queue_lengths(client, now):
    racer, track = a_racer("alice"), a_track()
    jobs = [queue_evaluation(owner=racer, model=a_model(racer), track=track, rules=RaceRules(), now=now) for _ in "123"]
    Evaluation.objects.filter(pk=jobs[0].pk).update(
        state=State.RUNNING, lease=uuid.uuid4(), leased_until=now + MINUTE, started_at=now, worker="w@one"
    )
    Evaluation.objects.filter(pk=jobs[1].pk).update(queued_at=now - 7 * MINUTE)
    start_worker(name="w@one", queues=["celery"], processes=1)
    start_worker(name="t@two", queues=["training"], processes=1, now=now - timedelta(hours=1))
    training = a_training(racer, track, now)
    html = client.get("/workers/").content.decode()
    assert "alive" in row(html, "w@one") and jobs[0].public_id in row(html, "w@one") and "alice" in row(html, "w@one")
    assert "no heartbeat" in row(html, "t@two")
    assert row(html, "evaluations").startswith("Evaluations 2 1 7 min ago 1 none")
    assert row(html, "trainings").startswith("Trainings 1 0") and "just now 0 none" in row(html, "trainings")
    assert TrainingJob.objects.get(pk=training.pk).state == JobState.QUEUED


def test_a_held_worker_is_shown_as_such(client, now):
    for name in ("p@one", "d@one", "e@one"):
        start_worker(name=name, queues=["celery"], processes=1)
    order_workers(names=["p@one"], order="pause", now=now)
    order_workers(names=["d@one", "e@one"], order="drain", now=now)
    stop_worker(name="e@one")
    html = client.get("/workers/").content.decode()
    assert [row(html, name).split()[1] for name in ("p@one", "d@one", "e@one")] == ["paused", "draining", "drained"]
    assert 'class="bad"' not in html and "/admin/evaluation/workernode/" in html


def test_recent_failures_are_counted_by_reason(client, now):
    racer, track = a_racer(), a_track()
    jobs = [
        queue_evaluation(owner=racer, model=a_model(racer), track=track, rules=RaceRules(), now=now) for _ in "1234"
    ]
    pks = [one.pk for one in jobs]
    fail(Evaluation.objects.filter(pk__in=pks[:2]), "internal_error", now)
    fail(Evaluation.objects.filter(pk=pks[2]), "network_too_slow", now)
    fail(Evaluation.objects.filter(pk=pks[3]), "internal_error", now - timedelta(hours=2))
    (queue,) = [one for one in queues_at(now, []) if one.queue.name == "evaluations"]
    assert [(one.code, one.count, one.ours) for one in queue.failed] == [
        ("internal_error", 2, True),
        ("network_too_slow", 1, False),
    ]
    assert "2 × internal_error platform 1 × network_too_slow" in row(
        client.get("/workers/").content.decode(), "evaluations"
    )


def proof(equal: int, **more) -> dict:
    differ = ["hairpins at speed", "bots that change lanes", "a duel"][: 3 - equal]
    return {**Proof("paddock-v9", 3, equal, tuple(differ), "why").to_dict(), **more}


def test_a_worker_whose_golden_runs_differ_is_shown_as_refusing(client, now):
    for name, given in {"good": proof(3), "bad": proof(1), "let": proof(2, allowed=True), "new": {}}.items():
        start_worker(name=f"{name}@one", queues=["celery"], processes=1)
        WorkerNode.objects.filter(name=f"{name}@one").update(proof=given)
    html = client.get("/workers/").content.decode()
    assert row(html, "good@one").endswith("exact: 3 of 3") and "alive" in row(html, "good@one")
    assert row(html, "bad@one").endswith("equal: 1 of 3 hairpins at speed bots that change lanes")
    assert "takes no jobs" in row(html, "bad@one")
    assert "equal: 2 of 3 It takes jobs anyway" in row(html, "let@one") and "alive" in row(html, "let@one")
    assert row(html, "new@one").endswith("–")
    (queue,) = [one for one in queues_at(now, workers_at(now)) if one.queue.name == "evaluations"]
    assert queue.listening == 3, "one that refuses serves nobody"


def test_a_worker_with_a_weak_sandbox_is_shown_as_refusing(client):
    start_worker(name="w@one", queues=["celery"], processes=1)
    WorkerNode.objects.update(sandbox={"level": 1, "name": "partial", "sufficient": False})
    assert "takes no jobs" in row(client.get("/workers/").content.decode(), "w@one")
    assert "1 (partial) not enough" in row(client.get("/workers/").content.decode(), "w@one")


def test_a_worker_without_a_full_sandbox_says_what_is_missing(client):
    start_worker(name="w@one", queues=["celery"], processes=1)
    layers = [
        {"name": "lock", "available": True, "detail": "closed from inside"},
        {"name": "namespaces", "available": False, "detail": "bwrap: Creating new namespace failed"},
    ]
    WorkerNode.objects.update(sandbox={"level": 2, "name": "lock", "sufficient": True, "layers": layers})
    shown = row(client.get("/workers/").content.decode(), "w@one")
    assert "namespaces: bwrap: Creating new namespace failed" in shown and "closed from inside" not in shown


def test_many_workers_need_no_more_queries(client, now, django_assert_max_num_queries):
    for number in range(30):
        start_worker(name=f"w@{number}", queues=["celery"], processes=1)
    with django_assert_max_num_queries(26):
        client.get("/workers/")


# --- run again -----------------------------------------------------------------------------------------------------


@pytest.fixture
def failures(now) -> dict[str, list[Evaluation]]:
    """Three of one reason (two in a race, one in a garage), one of another, one of yesterday."""
    race, track = a_race(timezone.now()), a_track()
    sent = [
        submit_model(race=race, racer=one, model=a_model(one), now=timezone.now()) for one in (a_racer(), a_racer())
    ]
    alone = a_racer()
    free = [
        queue_evaluation(owner=alone, model=a_model(alone), track=track, rules=RaceRules(), now=now) for _ in range(3)
    ]
    ours = [*(one.evaluation for one in sent), free[0]]
    fail(Evaluation.objects.filter(pk__in=[one.pk for one in ours]), "internal_error", now)
    fail(Evaluation.objects.filter(pk=free[1].pk), "network_too_slow", now, "w@two")
    fail(Evaluation.objects.filter(pk=free[2].pk), "internal_error", now - timedelta(days=1))
    return {"ours": ours, "slow": [free[1]], "old": [free[2]]}


def test_only_the_filtered_failed_runs_are_retried(client, failures):
    path = "/workers/evaluations/failed/"
    html = client.get(f"{path}?reason=internal_error&hours=1").content.decode()
    assert "3 failed runs" in html and all(one.public_id in html for one in failures["ours"])
    assert failures["slow"][0].public_id not in html and failures["old"][0].public_id not in html
    answer = client.post(path, {"reason": "internal_error", "hours": "1", "worker": ""}, follow=True)
    assert "3 runs queued again." in answer.content.decode()
    assert Evaluation.objects.filter(state=State.QUEUED).count() == 3
    free = failures["ours"][2]
    free.refresh_from_db()
    assert (free.state, free.attempt, free.reason_code, free.ended_at) == (State.QUEUED, 0, "", None)
    assert Entry.objects.filter(submissions__is_void=True).count() == 2, (
        "a race's run is sent again, the old one is void"
    )
    for one in (*failures["slow"], *failures["old"]):
        one.refresh_from_db()
        assert one.state == State.FAILED
    assert LogEntry.objects.filter(change_message="Run again").count() == 3
    again = client.post(path, {"reason": "internal_error", "hours": "1", "worker": ""}, follow=True).content.decode()
    assert "There is nothing to run again." in again and Evaluation.objects.filter(state=State.QUEUED).count() == 3


def test_a_run_that_cannot_be_retried_does_not_block_others(client, failures):
    entry = Entry.objects.order_by("pk").first()
    other = a_model(entry.racer)
    submit_model(race=entry.race, racer=entry.racer, model=other, now=timezone.now())
    html = client.post("/workers/evaluations/failed/", {"hours": "0", "worker": "w@one"}, follow=True).content.decode()
    assert "3 runs queued again." in html and "1 unchanged:" in html


def test_a_training_without_checkpoints_starts_over(client, now):
    job = a_training(a_racer(), a_track(), now)
    mine = TrainingJob.objects.filter(pk=job.pk)
    mine.update(state="failed", reason_code="training_gave_up", ended_because="failed", ended_at=now, attempt=3)
    html = client.get("/workers/trainings/failed/").content.decode()
    assert job.public_id in html or job.name in html
    client.post("/workers/trainings/failed/", {"hours": "1"})
    job.refresh_from_db()
    assert (job.state, job.attempt, job.reason_code, job.ended_because, job.ended_at) == ("queued", 0, "", "", None)


def test_a_failed_video_is_retried(client, now):
    run = a_driven_run(a_race(timezone.now()), a_racer(), timezone.now())
    video = Video.objects.create(
        evaluation=run, language="en", state=VideoState.FAILED, reason_code="video_stopped", ended_at=now
    )
    client.post("/workers/videos/failed/", {"hours": "1"})
    video.refresh_from_db()
    assert (video.state, video.reason_code, video.ended_at) == (VideoState.WAITING, "", None)


def test_retrying_needs_the_permission_to_change_evaluations(failures):
    client = Client()
    client.force_login(a_racer("helper", is_staff=True), backend="django.contrib.auth.backends.ModelBackend")
    assert client.get("/workers/").status_code == 403
    assert client.post("/workers/evaluations/failed/", {"hours": "0"}).status_code == 403
    assert not Evaluation.objects.filter(state=State.QUEUED).exists()
