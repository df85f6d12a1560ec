"""A nightly sample of official results is driven again elsewhere; a difference is an alarm and changes no result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from io import BytesIO

import pytest
from django.db import IntegrityError, transaction
from django.db.models import QuerySet
from django.db.models.functions import Now
from django.urls import reverse
from django.utils import timezone

from config.operations import doctor, health
from core.events import Event
from core.jobs.holds import hold_workers
from core.jobs.models import WorkerHold
from evaluation.garage.services import upload_model
from evaluation.models import Evaluation, Result, WorkerNode
from evaluation.reports.services import request_report
from evaluation.running import pipeline
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.running.worker_nodes import start_worker
from league.house_cars.services import house_cars
from league.models import Mail, Notice
from league.notices.reader import NOTICES
from paddock.errors import PlatformFault, UserFault
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from races.models import Elsewhere, Race, Recheck, RecheckState
from races.rechecks.jobs import KEPT, PATIENCE, RECHECKS, run_next_recheck
from races.rechecks.services import draw_sample, examine, unexamined
from tests.factories import a_race, a_racer, a_track, drive, laps, outcome
from tests.kept import Kept
from tests.rows import model_row, track_row

pytestmark = pytest.mark.django_db
MINUTE = timedelta(minutes=1)
HOUR = timedelta(hours=1)
DRIVEN = laps(9_000, 9_100, 9_200)
CAR = house_cars()[0]


@pytest.fixture(autouse=True)
def every_wake(wakes, settings):
    settings.RECHECK_SAMPLE, settings.RECHECK_HOUR = 2, 3


@pytest.fixture
def night(now):
    return (now + timedelta(days=30)).replace(hour=3)


@pytest.fixture(scope="session")
def kept_rechecked(request: pytest.FixtureRequest, keep: Callable, now) -> Kept:
    return keep(request, lambda: _results(now))


@pytest.fixture
def results(kept_rechecked: Kept, db: None):
    return kept_rechecked.copy()


def _results(now):
    """Five results of a race that closes before the night, driven by celery@one."""
    race = a_race(now)
    runs = [drive(race, a_racer(), DRIVEN, now).evaluation for _ in range(5)]
    Race.objects.update(closes_at=now + HOUR, engine=ENGINE_ID)
    Result.objects.update(engine=ENGINE_ID, cpu_model="EPYC")
    Evaluation.objects.update(worker="celery@one")
    return runs


@pytest.fixture
def recheck(results, night, settings):
    settings.RECHECK_SAMPLE = 1
    assert draw_sample(now=night) == 1
    return Recheck.objects.get()


def comes_to(monkeypatch, **changes):
    """The next run comes to what the stored ones came to, but for these changes."""
    driven = replace(outcome(DRIVEN), engine=ENGINE_ID, cpu_model="Xeon", **changes)
    monkeypatch.setattr(pipeline, "evaluate", lambda job, **options: driven)
    monkeypatch.setattr("races.rechecks.jobs.job_of", lambda evaluation: None)


def worker(name: str, cpu: str = "EPYC") -> None:
    start_worker(name=name, queues=["celery"], processes=1)
    WorkerNode.objects.filter(name=name).update(cpu_model=cpu)


class TestSample:
    def test_it_is_drawn_once_a_day_after_its_hour(self, results, night):
        assert draw_sample(now=night - MINUTE) == 0
        assert draw_sample(now=night) == 2
        assert draw_sample(now=night + HOUR) == 0
        assert draw_sample(now=night + timedelta(days=1)) == 2
        assert Recheck.objects.count() == 4

    def test_the_day_alone_decides(self, results, night):
        draw_sample(now=night)
        first = list(Recheck.objects.values_list("number", "evaluation"))
        Recheck.objects.all().delete()
        draw_sample(now=night + 9 * HOUR)
        assert list(Recheck.objects.values_list("number", "evaluation")) == first
        drawn = set()
        for day in range(20):
            draw_sample(now=night + timedelta(days=day))
            drawn |= set(Recheck.objects.values_list("evaluation", flat=True))
        assert drawn == {run.pk for run in results}

    def test_a_second_scheduler_adds_none(self, results, night, monkeypatch):
        assert draw_sample(now=night) == 2
        monkeypatch.setattr(QuerySet, "exists", lambda self: False)  # it has looked before the first wrote
        draw_sample(now=night)
        assert Recheck.objects.count() == 2

    def test_the_database_refuses_a_second_row_for_a_place(self, recheck, results):
        other = next(run for run in results if run.pk != recheck.evaluation_id)
        for run, number in ((other, recheck.number), (recheck.evaluation, 9)):
            with pytest.raises(IntegrityError), transaction.atomic():
                Recheck.objects.create(day=recheck.day, number=number, evaluation=run)

    def test_none_is_drawn_where_it_is_off(self, results, night, settings):
        settings.RECHECK_SAMPLE = 0
        assert draw_sample(now=night) == 0

    @pytest.mark.parametrize(
        "fields", [{"closes_at": timezone.now() + timedelta(days=9_999)}, {"cancelled_at": timezone.now()}]
    )
    def test_a_race_that_is_not_over_has_no_official_results(self, results, night, fields):
        Race.objects.update(**fields)
        assert draw_sample(now=night) == 0

    def test_results_of_another_engine_are_passed_by(self, results, night):
        Result.objects.update(engine="paddock-v0")
        assert draw_sample(now=night) == 0


class TestClaim:
    def test_other_runs_go_first(self, recheck, alice, night):
        car = {"owner": alice, "model": model_row(alice)}
        run = queue_evaluation(**car, track=a_track(), rules=RaceRules(), priority=-20, now=night)
        assert RECHECKS.claim(worker="w", now=night) is None
        run.delete()
        report = request_report(**car, track_set="chosen", tracks=[a_track()], now=night)
        assert RECHECKS.claim(worker="w", now=night) is None
        report.delete()
        assert RECHECKS.claim(worker="w", now=night) == recheck

    def test_a_worker_leaves_it_to_those_farther_from_the_run(self, recheck):
        now = timezone.now()
        Recheck.objects.update(queued_at=now)
        ranked = (("celery@one", "EPYC"), ("other@one", "EPYC"), ("celery@two", "EPYC"), ("celery@three", "Xeon"))
        for name, cpu in ranked:
            worker(name, cpu)
        assert [RECHECKS.claim(worker=name, now=now) for name, _ in ranked[:3]] == [None] * 3
        WorkerNode.objects.filter(name="celery@three").update(sandbox={"sufficient": False})
        assert [RECHECKS.claim(worker=name, now=now) for name, _ in ranked[:2]] == [None] * 2
        hold_workers(workers=["celery@two"], mode=WorkerHold.Mode.PAUSED, now=now)
        assert RECHECKS.claim(worker="celery@one", now=now) is None
        WorkerNode.objects.filter(name="other@one").update(seen_at=Now() - HOUR)
        assert RECHECKS.claim(worker="celery@one", now=now) == recheck, "there is no other"

    def test_any_worker_will_do_after_an_hour(self, recheck, night):
        worker("celery@one")
        worker("celery@two")
        Recheck.objects.update(queued_at=timezone.now() - PATIENCE)
        assert RECHECKS.claim(worker="celery@one", now=timezone.now()) == recheck

    def test_what_nobody_drove_for_two_days_is_given_up(self, recheck, night):
        RECHECKS.sweep(now=night + KEPT)
        assert Recheck.objects.get().state == RecheckState.QUEUED
        RECHECKS.sweep(now=night + KEPT + MINUTE)
        recheck.refresh_from_db()
        assert (recheck.state, recheck.reason_code, recheck.same) == (RecheckState.FAILED, "recheck_late", None)

    def test_one_of_an_engine_that_has_gone_is_not_driven(self, recheck, night):
        Result.objects.update(engine="paddock-v0")
        assert RECHECKS.claim(worker="w", now=night) is None


class TestVerdict:
    def test_one_that_agrees_is_no_alarm(self, recheck, monkeypatch):
        comes_to(monkeypatch)
        assert run_next_recheck(worker="celery@two")
        recheck.refresh_from_db()
        result = recheck.evaluation.result
        assert (recheck.state, recheck.same, recheck.differences) == (RecheckState.FINISHED, True, {})
        assert recheck.measured_sha256 == result.trace_sha256
        assert (recheck.elsewhere, recheck.measured_cpu) == (Elsewhere.PROCESSOR, "Xeon")
        assert not Event.objects.filter(kind="result.differs").exists() and not unexamined().exists()

    def test_a_newer_library_alone_is_no_other_result(self, recheck, monkeypatch):
        comes_to(monkeypatch, versions={"numpy": "99.0"})
        run_next_recheck(worker="celery@two")
        recheck.refresh_from_db()
        assert (recheck.same, recheck.differences) == (True, {}) and not unexamined().exists()

    def test_a_forged_result_raises_the_alarm_and_stays(self, recheck, monkeypatch):
        result = Result.objects.get(evaluation=recheck.evaluation)
        Result.objects.filter(pk=result.pk).update(trace_sha256="0" * 64)
        before = Result.objects.filter(pk=result.pk).values().get()
        comes_to(monkeypatch)
        run_next_recheck(worker="celery@one")
        recheck.refresh_from_db()
        assert (recheck.same, recheck.differences) == (False, {"trace_sha256": ["0" * 64, result.trace_sha256]})
        assert recheck.measured_engine == ENGINE_ID
        event = Event.objects.get(kind="result.differs")
        assert (event.subject, event.data) == (recheck.evaluation.public_id, {"recheck": recheck.pk})
        assert Result.objects.filter(pk=result.pk).values().get() == before
        assert "results" in {name for name, good in health.look().parts.items() if not good}
        (line,) = [line for line in doctor.parts() if line.name == "results"]
        assert line.status == "fail" and "Rechecks" in line.detail

    def test_one_that_is_now_refused_differs(self, recheck, monkeypatch):
        comes_to(monkeypatch)
        monkeypatch.setattr(pipeline, "evaluate", refuse(UserFault("policy_died", step=3, how="signal 11")))
        run_next_recheck(worker="w")
        recheck.refresh_from_db()
        assert (recheck.same, recheck.differences) == (False, {"end": ["finished", "policy_died"]})

    def test_a_fault_of_ours_is_tried_again(self, recheck, monkeypatch):
        comes_to(monkeypatch)
        monkeypatch.setattr(pipeline, "evaluate", refuse(PlatformFault("runner_died")))
        run_next_recheck(worker="w")
        recheck.refresh_from_db()
        assert (recheck.state, recheck.same) == (RecheckState.QUEUED, None)

    def test_admins_get_a_notice_and_a_mail(self, recheck, alice, monkeypatch):
        boss = a_racer("boss", is_staff=True, is_superuser=True)
        boss.emailaddress_set.create(email="boss@example.org", verified=True, primary=True)
        Result.objects.update(trace_sha256="0" * 64)
        comes_to(monkeypatch)
        run_next_recheck(worker="celery@two")
        NOTICES.handle(Event.objects.get(kind="result.differs"), timezone.now())
        notice = Notice.objects.get()
        assert (notice.racer, notice.kind) == (boss, "differs") and "trace_sha256" in notice.params["what"]
        assert notice.path == reverse("admin:races_recheck_change", args=[recheck.pk])
        assert Mail.objects.get().notice == notice


class TestAdmin:
    @pytest.fixture
    def different(self, recheck, monkeypatch):
        Result.objects.update(trace_sha256="0" * 64)
        comes_to(monkeypatch)
        run_next_recheck(worker="celery@two")
        recheck.refresh_from_db()
        return recheck

    def test_the_list_has_both_sides_and_an_action_ends_the_alarm(self, different, client):
        client.force_login(
            a_racer("boss", is_staff=True, is_superuser=True), backend="django.contrib.auth.backends.ModelBackend"
        )
        page = reverse("admin:races_recheck_changelist")
        html = client.get(page).content.decode()
        for shown in ("0" * 64, different.measured_sha256, ENGINE_ID, "EPYC", "Xeon", "celery@one", "celery@two"):
            assert shown in html
        assert client.get(reverse("admin:races_recheck_change", args=[different.pk])).status_code == 200
        answer = client.post(page, {"action": "examined", "_selected_action": [different.pk]}, follow=True)
        assert "1 difference examined." in answer.content.decode()
        assert not unexamined().exists() and health.look().parts["results"]

    def test_only_a_difference_can_be_examined(self, recheck, night):
        assert examine(rechecks=Recheck.objects.all(), now=night) == 0
        with pytest.raises(IntegrityError), transaction.atomic():
            Recheck.objects.update(examined_at=night)


def refuse(fault):
    def play(*args, **kwargs):
        raise fault

    return play


@pytest.mark.slow
def test_a_real_run_agrees_and_a_forged_one_does_not(alice):
    files = [UploadPart(path.name, BytesIO(path.read_bytes())) for path in (CAR.onnx, CAR.metadata)]
    model = upload_model(owner=alice, files=files, now=timezone.now()).model
    rules = RaceRules(laps=1)
    run = queue_evaluation(owner=alice, model=model, track=track_row("oval"), rules=rules, now=timezone.now())
    assert run_next_evaluation(worker="celery@one")
    for number, same in ((1, True), (2, False)):
        day = timezone.now().date() + timedelta(days=number)
        recheck = Recheck.objects.create(day=day, number=number, evaluation=run)
        assert run_next_recheck(worker="celery@two")
        recheck.refresh_from_db()
        assert (recheck.same, recheck.elsewhere) == (same, Elsewhere.MACHINE), recheck.operator_detail
        assert recheck.measured_sha256 == Result.objects.get().trace_sha256 or not same
        Result.objects.update(trace_sha256="0" * 64)
