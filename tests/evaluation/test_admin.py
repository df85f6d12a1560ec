"""What an admin sees and may do; that nobody can edit what was measured."""

from __future__ import annotations

import pytest
from django.contrib.admin.models import LogEntry
from django.contrib.auth.models import Permission
from django.urls import reverse
from django.utils import timezone

from accounts.models import Racer
from core.jobs.holds import hold_of
from evaluation.models import Evaluation, State, TrainedModel, WorkerNode
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.rows import model_row

pytestmark = pytest.mark.django_db


@pytest.fixture
def admin(client):
    racer = Racer.objects.create_superuser("chief", "chief@example.org", "correct horse battery")
    client.force_login(racer)
    return client


@pytest.fixture
def evaluations(alice, oval, wakes):
    """One that is finished, one that waits."""
    model = model_row(alice)
    for _ in range(2):
        queue_evaluation(owner=alice, model=model, track=oval, rules=RaceRules(), now=timezone.now())
    claimed = EVALUATIONS.claim(worker="w", now=timezone.now())
    finish_evaluation(pk=claimed.pk, lease=claimed.lease, outcome=outcome_of(), now=timezone.now())
    WorkerNode.objects.create(name="w", seen_at=timezone.now(), sandbox={"level": 3, "name": "lock"}, engine="e")
    return Evaluation.objects.order_by("pk")


@pytest.mark.parametrize("name", ["network", "trainedmodel", "evaluation", "result", "workernode"])
def test_every_list_and_row_is_read_only(admin, evaluations, name):
    listing = reverse(f"admin:evaluation_{name}_changelist")
    assert admin.get(listing, {"q": "x"}).status_code == 200
    model = {"network": evaluations[0].model.network, "trainedmodel": evaluations[0].model}.get(name)
    rows = {"evaluation": evaluations[0], "result": evaluations[0].result, "workernode": WorkerNode.objects.get()}
    row = model or rows[name]
    page = reverse(f"admin:evaluation_{name}_change", args=[row.pk])
    assert admin.get(page).status_code == 200
    assert admin.post(page, {}).status_code == 403
    assert admin.post(reverse(f"admin:evaluation_{name}_delete", args=[row.pk]), {"post": "yes"}).status_code == 403
    assert admin.get(reverse(f"admin:evaluation_{name}_add")).status_code == 403


def test_a_runs_page_shows_the_other_cars_and_their_results(admin, alice, oval, wakes):
    cars = [model_row(alice, name=name, onnx=name.encode()) for name in ("Bolt", "Nut")]
    rules = RaceRules(race_type="head_to_head")
    queue_evaluation(owner=alice, model=cars[0], rivals=cars[1:], track=oval, rules=rules, now=timezone.now())
    claimed = EVALUATIONS.claim(worker="w", now=timezone.now())
    outcome = outcome_of(rivals=[car_outcome(laps=(7_654,), retired="policy_died")])
    finish_evaluation(pk=claimed.pk, lease=claimed.lease, outcome=outcome, now=timezone.now())
    page = admin.get(reverse("admin:evaluation_evaluation_change", args=[claimed.pk])).content.decode()
    assert "Nut" in page
    result = reverse("admin:evaluation_result_change", args=[claimed.result.pk])
    assert result in page
    page = admin.get(result).content.decode()
    assert "policy_died" in page and "7654" in page


def test_an_admin_can_stop_only_waiting_runs(admin, evaluations):
    answer = admin.post(
        reverse("admin:evaluation_evaluation_changelist"),
        {"action": "stop", "_selected_action": [row.pk for row in evaluations]},
        follow=True,
    )
    assert "1 evaluation was stopped." in answer.content.decode()
    assert [row.state for row in evaluations.all()] == [State.FINISHED, State.STOPPED]


def order(client, what):
    page = reverse("admin:evaluation_workernode_changelist")
    return client.post(page, {"action": what, "_selected_action": [WorkerNode.objects.get().pk]}, follow=True)


def test_an_admin_pauses_drains_and_resumes_a_worker(admin, evaluations):
    assert order(admin, "pause").status_code == 200 and hold_of("w") == "paused"
    assert EVALUATIONS.claim(worker="w", now=timezone.now()) is None
    order(admin, "drain")
    assert hold_of("w") == "drained"
    assert "drained" in admin.get(reverse("admin:evaluation_workernode_changelist")).content.decode()
    order(admin, "resume")
    assert hold_of("w") == "" and EVALUATIONS.claim(worker="w", now=timezone.now()) is not None
    assert [entry.change_message for entry in LogEntry.objects.order_by("pk")] == ["pause", "drain", "resume"]


@pytest.mark.parametrize("permission", ["", "view_workernode"])
def test_orders_need_the_permission_to_change_workers(client, alice, evaluations, permission):
    alice.is_staff = True
    alice.save()
    alice.user_permissions.set(Permission.objects.filter(codename=permission))
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    for what in ("pause", "drain"):
        order(client, what)
        assert hold_of("w") == ""


def test_an_admin_sweeps_the_queue(admin, evaluations):
    EVALUATIONS.claim(worker="dead", now=timezone.now() - timezone.timedelta(hours=1))
    answer = admin.post(
        reverse("admin:evaluation_evaluation_changelist"),
        {"action": "sweep", "_selected_action": [evaluations[0].pk]},
        follow=True,
    )
    assert "Put back: 1, waiting: 1." in answer.content.decode()


def test_an_admin_removes_a_model_from_a_garage(admin, evaluations):
    model = TrainedModel.objects.get()
    admin.post(
        reverse("admin:evaluation_trainedmodel_changelist"),
        {"action": "delete_from_garage", "_selected_action": [model.pk]},
    )
    model.refresh_from_db()
    assert model.deleted_at is not None
