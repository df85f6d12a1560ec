"""What holds for every kind of job: :mod:`core.jobs`."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest
from django.apps import apps
from django.db import IntegrityError, transaction

from config.celery import app
from core.jobs.kinds import all_kinds
from core.jobs.models import Leased, Outage
from core.jobs.retried import RetriedKind
from paddock.errors import PlatformFault, UserFault
from tests.races.test_concurrency import at_once

from .kinds import EVALUATIONS, INVITATIONS, MAILS, MAKERS, VIDEOS, of_each

SECOND = timedelta(seconds=1)
pytestmark = pytest.mark.django_db
GO_ON = of_each(
    kind for kind in MAKERS if kind not in (MAILS, INVITATIONS)
)  # a mail that may have gone is not sent twice
RETRIED = of_each(kind for kind in MAKERS if isinstance(kind, RetriedKind))


def key(job) -> dict:
    return {"pk": job.pk, "lease": job.lease}


def test_every_table_of_jobs_is_a_tested_kind():
    tables = {model for model in apps.get_models() if issubclass(model, Leased)}
    kinds = all_kinds()
    assert {kind.model for kind in kinds} == tables and len(kinds) == len(tables)
    assert set(kinds) == set(MAKERS)


def test_its_task_is_known_to_workers(kind):
    app.loader.import_default_modules()
    assert kind.task in app.tasks
    assert app.amqp.router.route({}, kind.task)["queue"].name == kind.queue


@pytest.mark.parametrize(
    ("task", "queue"),
    [
        ("evaluation.tasks.sweep", "celery"),
        ("evaluation.tasks.sweep_reports", "celery"),
        # idle workers of these have no process for it
        ("training.tasks.sweep", "messages"),
        ("videos.tasks.sweep", "messages"),
    ],
)
def test_each_sweep_goes_to_workers_that_have_a_process(task, queue):
    app.loader.import_default_modules()
    assert task in app.tasks
    assert app.amqp.router.route({}, task)["queue"].name == queue


class TestClaim:
    def test_it_records_the_worker_and_the_lease(self, kind, waiting, now):
        job = kind.claim(worker="w" * 200, now=now)
        assert (job.state, job.attempt, job.started_at) == (kind.working, 1, now)
        assert (job.worker, job.leased_until) == ("w" * 128, now + kind.lease)
        assert kind.claim(worker="other", now=now) is None

    def test_it_skips_a_paused_job(self, kind, waiting, now):
        kind.model.objects.filter(pk=waiting.pk).update(
            not_before=now + SECOND, **({"failed_at": now} if isinstance(kind, RetriedKind) else {})
        )
        assert kind.claim(worker="w", now=now) is None
        assert kind.claim(worker="w", now=now + SECOND) == waiting

    def test_it_waits_during_an_outage_of_a_needed_part(self, kind, waiting, now):
        Outage.objects.create(part="storage", since=now, look_at=now + SECOND)
        assert (kind.claim(worker="w", now=now) is None) == ("storage" in kind.needs)

    def test_it_fails_for_a_job_stopped_at_that_moment(self, kind, waiting, now, monkeypatch):
        held = kind.held

        def stopped_meanwhile(pk, lease):
            kind.end(kind.under_way(pk), state=kind.failed, now=now, **reason(kind))
            return held(pk, lease)

        monkeypatch.setattr(kind, "held", stopped_meanwhile)
        assert kind.claim(worker="w", now=now) is None


@pytest.mark.django_db(transaction=True)
def test_it_succeeds_for_one_of_many_workers(kind, waiting, now):
    answers = at_once([lambda n=n: kind.claim(worker=f"w{n}", now=now) for n in range(4)])
    assert [job for job in answers if job is not None] == [waiting], answers


class TestLease:
    def test_a_foreign_lease_changes_nothing(self, kind, claimed, now):
        other = {"pk": claimed.pk, "lease": uuid.uuid4()}
        assert not kind.beat(**other, now=now)
        assert not kind.release(**other, now=now)
        assert not kind.end(kind.held(**other), state=kind.finished, now=now)
        assert not kind.put_back(kind.held(**other), now=now)
        if isinstance(kind, RetriedKind):
            assert not kind.fail(**other, fault=UserFault("stopped"), now=now)
        row = kind.model.objects.get(pk=claimed.pk)
        assert (row.state, row.lease, row.leased_until) == (kind.working, claimed.lease, claimed.leased_until)

    def test_a_heartbeat_prolongs_the_lease(self, kind, claimed, now):
        assert kind.beat(**key(claimed), now=now + 9 * SECOND)
        claimed.refresh_from_db()
        assert claimed.leased_until == now + 9 * SECOND + kind.lease

    @GO_ON
    def test_an_expired_lease_is_taken_back(self, kind, claimed, now):
        assert kind.sweep(now=claimed.leased_until).requeued == 0
        after = claimed.leased_until + SECOND
        assert kind.sweep(now=after).requeued == 1
        again = kind.claim(worker="second", now=after)
        assert (again, again.attempt) == (claimed, 2)
        assert again.lease != claimed.lease
        assert not kind.beat(**key(claimed), now=after)

    def test_a_lease_of_a_clock_that_was_set_back_ends_in_time(self, kind, claimed, now):
        kind.model.objects.filter(pk=claimed.pk).update(leased_until=now + 10 * kind.lease)
        assert kind.sweep(now=now).requeued == 0
        claimed.refresh_from_db()
        assert (claimed.state, claimed.leased_until) == (kind.working, now + kind.lease)
        assert kind.beat(**key(claimed), now=now + SECOND), "a living worker goes on"

    def test_an_outage_of_a_clock_that_was_set_back_is_looked_after(self, kind, waiting, now):
        ahead = now + timedelta(hours=1)
        Outage.objects.create(part="storage", since=ahead, look_at=ahead + SECOND)
        kind.sweep(now=now)
        assert not Outage.objects.exists() or "storage" not in kind.needs

    def test_a_released_lease_costs_no_attempt(self, kind, claimed, now, woken, django_capture_on_commit_callbacks):
        woken.clear()
        with django_capture_on_commit_callbacks(execute=True):
            assert kind.release(**key(claimed), now=now)
        claimed.refresh_from_db()
        assert (claimed.state, claimed.attempt, claimed.lease) == (kind.waiting, 0, None)
        assert woken == [(kind.task, kind.queue)]

    @GO_ON
    def test_losing_hosts_repeatedly_never_fails_the_job(self, kind, claimed, now):
        for attempt in range(2, 12):
            now += timedelta(hours=3)
            kind.sweep(now=now)
            claimed = kind.claim(worker="w", now=now + timedelta(hours=2))
            assert claimed.attempt == attempt


class TestSweep:
    def test_it_wakes_a_worker_for_waiting_jobs(self, kind, waiting, now, woken, django_capture_on_commit_callbacks):
        woken.clear()
        with django_capture_on_commit_callbacks(execute=True):
            assert kind.sweep(now=now).waiting == 1
        assert woken == [(kind.task, kind.queue)]

    def test_it_wakes_nobody_if_nothing_waits(self, kind, claimed, now, woken, django_capture_on_commit_callbacks):
        woken.clear()
        with django_capture_on_commit_callbacks(execute=True):
            assert kind.sweep(now=now).waiting == 0
        assert woken == []

    def test_it_continues_past_a_job_it_cannot_requeue(self, kind, claimed, now, monkeypatch, caplog):
        def refuse(*args):
            raise RuntimeError("a receiver failed")

        monkeypatch.setattr(kind, "lost", refuse)
        assert kind.sweep(now=claimed.leased_until + SECOND).requeued == 0
        assert "cannot be ended" in caplog.text


@RETRIED
class TestFault:
    def test_a_user_fault_is_final_immediately(self, retried, claimed, now):
        fault = UserFault("policy_late", step=7, step_s=1, overage_s=10, total_s=60)
        assert retried.fail(**key(claimed), fault=fault, now=now, detail="stderr")
        claimed.refresh_from_db()
        assert (claimed.state, claimed.reason, claimed.ended_at) == (retried.failed, str(fault), now)
        assert "stderr" in claimed.operator_detail and not claimed.is_platform_fault

    def test_a_platform_fault_is_retried_after_growing_pauses(self, retried, claimed, now, settings):
        settings.EVALUATION_MAX_ATTEMPTS = 2
        pauses = []
        for _ in range(8):
            assert retried.fail(**key(claimed), fault=PlatformFault("storage_failed"), now=now, detail="Traceback")
            claimed.refresh_from_db()
            assert (claimed.state, claimed.reason_code, claimed.failed_at) == (retried.waiting, "", now)
            pauses.append((claimed.not_before - now).total_seconds() if claimed.not_before else 0)
            now = claimed.not_before or now
            claimed = retried.claim(worker="w", now=now)
        assert pauses == [0, 4, 16, 64, 256, 1024, 3600, 3600]
        assert claimed.operator_detail.count("Traceback") == 8

    def test_a_platform_fault_without_a_pause_wakes_a_worker(
        self, retried, claimed, now, woken, django_capture_on_commit_callbacks
    ):
        woken.clear()
        with django_capture_on_commit_callbacks(execute=True):
            retried.fail(**key(claimed), fault=PlatformFault("internal_error"), now=now)
        assert woken == [(retried.task, retried.queue)]

    def test_operator_details_keep_the_newest_attempts(self, retried, claimed, now):
        for number in range(8):
            fault = PlatformFault("internal_error")
            retried.fail(**key(claimed), fault=fault, now=now, detail=f"{number}" * 5_000)
            now += timedelta(hours=2)
            claimed = retried.claim(worker="w", now=now)
        detail = retried.model.objects.get(pk=claimed.pk).operator_detail
        assert len(detail) == 20_000 and "Attempt 8: internal_error. 7777" in detail and "Attempt 1:" not in detail

    def test_restarting_a_job_clears_its_fault(self, retried, claimed, now):
        retried.fail(**key(claimed), fault=UserFault("stopped"), now=now)
        failed = retried.model.objects.filter(pk=claimed.pk, state=retried.failed)
        own = {"ended_because": ""} if hasattr(claimed, "ended_because") else {}
        assert retried.begin_anew(failed, **own)
        assert not retried.begin_anew(failed, **own), "it waits already"
        claimed.refresh_from_db()
        assert (claimed.state, claimed.attempt, claimed.reason_code) == (retried.waiting, 0, "")
        assert retried.claim(worker="w", now=now).attempt == 1


@of_each((EVALUATIONS, VIDEOS))
def test_a_platform_fault_ends_only_a_job_that_keeps_failing_alone(retried, claimed, now, settings, monkeypatch):
    settings.EVALUATION_MAX_ATTEMPTS = 3
    monkeypatch.setattr(retried, "others_passed", lambda job: True)
    for kills in (1, 2, 3):
        assert (claimed.kills, claimed.state) == (kills - 1, retried.working)
        fault = PlatformFault("internal_error") if kills % 2 == 0 else PlatformFault(min(retried.alone), **HOW)
        monkeypatch.setattr(retried, "alone", retried.alone | {"internal_error"})
        retried.fail(**key(claimed), fault=fault, now=now)
        now += timedelta(hours=2)
        claimed = retried.claim(worker="w", now=now) or retried.model.objects.get(pk=claimed.pk)
    assert (claimed.state, claimed.reason_code, claimed.kills) == (retried.failed, retried.gave_up_code, 3)
    assert claimed.is_platform_fault


@RETRIED
class TestStorageReturns:
    def test_jobs_paused_during_the_outage_are_woken(self, retried, claimed, now):
        Outage.objects.create(part="storage", since=now, look_at=now + SECOND)
        retried.model.objects.filter(pk=claimed.pk).update(attempt=5)
        claimed.attempt = 5
        retried.fail(**key(claimed), fault=PlatformFault("internal_error"), now=now)
        claimed.refresh_from_db()
        retried.model.objects.filter(pk=claimed.pk).update(not_before=now + timedelta(hours=1))
        assert retried.sweep(now=now).waiting == 0
        assert retried.sweep(now=now + SECOND).waiting == 1
        assert retried.claim(worker="w", now=now + SECOND) == claimed


class TestDatabaseConstraints:
    def test_a_lease_contradicting_the_state_is_refused(self, kind, waiting, now):
        for changes in (
            {"state": "lost"},
            {"state": kind.working},
            {"lease": uuid.uuid4(), "leased_until": now},
            {"ended_at": now},
            {"state": kind.failed, **reason(kind)},
        ):
            with pytest.raises(IntegrityError), transaction.atomic():
                kind.model.objects.filter(pk=waiting.pk).update(**changes)

    def test_a_pause_of_a_job_that_is_not_waiting_is_refused(self, kind, claimed, now):
        with pytest.raises(IntegrityError), transaction.atomic():
            kind.model.objects.filter(pk=claimed.pk).update(not_before=now)


HOW = {"how": "signal 11"}


def reason(kind) -> dict:
    """What a failed row must say besides."""
    columns = {"reason_code": "stopped"} if isinstance(kind, RetriedKind) else {}
    return columns | ({"ended_because": "failed"} if kind.name == "Training" else {})
