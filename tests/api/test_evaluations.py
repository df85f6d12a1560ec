"""Evaluations and their files through the API."""

from __future__ import annotations

from datetime import timedelta
from unittest.mock import Mock

import pytest
from botocore.exceptions import EndpointConnectionError
from django.core.files.storage import FileSystemStorage
from django.utils import timezone

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from races.entries.services.submissions import submit_model
from races.models import Visibility
from tests.evaluation.stubs import car_outcome, outcome_of, trace_csv
from tests.factories import a_model, a_race, a_track, drive, fail, laps, start

pytestmark = pytest.mark.django_db
BOX = {"fraction": 0.5, "lane": "inner", "x": 1.0, "y": 2.0, "yaw": 0.25}


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def race(now, alice):
    return a_race(now, organiser=alice, visibility=Visibility.INVITATION)


def read(client, evaluation, part=""):
    return client.get(f"/api/v1/evaluations/{evaluation.public_id}/{part}")


def sent(racer, now, race=None):
    return submit_model(race=race or a_race(now), racer=racer, model=a_model(racer), now=now)


def test_an_evaluation_is_followed_from_the_queue_to_its_result(alice, bob, now, as_racer):
    sent(alice, now)
    submission = sent(bob, now + timedelta(seconds=1))
    client, evaluation = as_racer(bob), submission.evaluation
    waiting = read(client, evaluation).data
    assert (waiting["state"], waiting["queue"]["position"], waiting["queue"]["waiting"]) == ("queued", 2, 2)
    assert (waiting["result"], waiting["reason"], waiting["progress"]) == (None, None, None)
    assert waiting["race"] == {"slug": submission.entry.race.slug, "name": submission.entry.race.name}
    assert waiting["rules"]["laps"] == 3

    running = start(evaluation, now)
    progress = {"lap": 2, "laps": 3, "lap_ms": 1500, "total_ms": 12_000, "percent": 50.5, "x": 1.0, "y": 2.0}
    progress |= {"off_tracks": 1, "crashes": 0, "resets": 1, "last_lap_ms": 10_500, "bots": [[1.5, 2.5]], "rivals": []}
    assert EVALUATIONS.beat(pk=running.pk, lease=running.lease, progress=progress, now=now)
    shown = read(client, evaluation).data
    assert (shown["state"], shown["queue"], shown["progress"]) == ("running", None, progress)


def test_a_result_has_laps_files_and_the_engine(bob, now, as_racer):
    evaluation = drive(a_race(now), bob, laps(11_000, 10_000, 12_000), now).evaluation
    client = as_racer(bob)
    result = read(client, evaluation).data["result"]
    assert [lap["time_ms"] for lap in result["laps"]] == [11_000, 10_000, 12_000]
    assert (result["best_lap_ms"], result["total_ms"], result["engine"]) == (10_000, 33_000, ENGINE_ID)

    metrics = read(client, evaluation, "metrics/")
    assert (metrics.status_code, metrics["Content-Type"]) == (200, "application/json")
    assert metrics["Content-Disposition"] == f'attachment; filename="{evaluation.public_id}-metrics.json"'
    assert set(metrics.json()) == {"metrics"}

    trace = read(client, evaluation, "trace/")
    assert (trace.status_code, trace["Content-Type"]) == (200, "text/csv; charset=utf-8")
    assert trace["Content-Disposition"] == f'attachment; filename="{evaluation.public_id}-sim-trace.csv"'
    assert trace.content == trace_csv()


def test_a_missing_csv_trace_is_reported_as_json(bob, now, as_racer):
    evaluation = sent(bob, now).evaluation
    address = f"/api/v1/evaluations/{evaluation.public_id}/trace/"
    answer = as_racer(bob).get(address, headers={"Accept": "text/csv"})
    assert answer.status_code == 404
    assert answer.json()["code"] == "not_found"


def test_a_file_lost_by_the_storage_is_a_platform_fault(bob, now, as_racer):
    evaluation = drive(a_race(now), bob, laps(10_000, 10_000, 10_000), now).evaluation
    evaluation.result.trace.storage.delete(evaluation.result.trace.name)
    answer = read(as_racer(bob), evaluation, "trace/")
    assert (answer.status_code, answer.json()["code"], answer.json()["fault"]) == (503, "file_damaged", "platform")


def test_an_unresponsive_bucket_is_a_platform_fault(bob, now, as_racer, monkeypatch):
    evaluation = drive(a_race(now), bob, laps(10_000, 10_000, 10_000), now).evaluation
    away = EndpointConnectionError(endpoint_url="http://bucket")
    monkeypatch.setattr(FileSystemStorage, "_open", Mock(side_effect=away))
    answer = read(as_racer(bob), evaluation, "trace/")
    assert (answer.status_code, answer.json()["code"], answer.json()["fault"]) == (503, "storage_failed", "platform")


def test_a_failure_carries_its_code_its_fault_and_a_message(bob, now, as_racer):
    submission = sent(bob, now)
    fail(submission, UserFault("non_finite_action", step=17), now)
    shown = read(as_racer(bob), submission.evaluation).data
    assert shown["state"] == "failed"
    assert (shown["reason"]["code"], shown["reason"]["fault"]) == ("non_finite_action", "user")
    assert shown["reason"]["params"] == {"step": 17}
    assert "17" in shown["reason"]["sentence"]
    assert "operator_detail" not in shown


def test_an_owner_can_stop_an_evaluation_only_once(bob, now, as_racer):
    evaluation, client = sent(bob, now).evaluation, as_racer(bob)
    address = f"/api/v1/evaluations/{evaluation.public_id}/stop/"
    first = client.post(address)
    assert (first.status_code, first.data["state"], first.data["reason"]["code"]) == (200, "stopped", "stopped")
    again = client.post(address)
    assert (again.status_code, again.data) == (200, first.data)


def test_only_the_owner_and_admins_see_and_stop_a_waiting_run(bob, race, now, cast):
    cast["member"].post(f"/api/v1/invitations/{race.invitation}/")
    evaluation = sent(bob, now, race).evaluation
    seen = {role: read(client, evaluation).status_code for role, client in cast.items()}
    assert seen == {"owner": 200, "member": 200, "stranger": 404, "admin": 200, "anonymous": 404}
    address = f"/api/v1/evaluations/{evaluation.public_id}/stop/"
    stopped = {role: cast[role].post(address).status_code for role in ("owner", "stranger", "anonymous")}
    assert stopped == {"owner": 403, "stranger": 404, "anonymous": 401}
    assert Evaluation.objects.get(pk=evaluation.pk).state == "queued"
    assert cast["admin"].post(address).data["state"] == "stopped"


@pytest.mark.parametrize("part", ["", "metrics/", "trace/"])
def test_only_runs_on_a_public_board_are_public(bob, now, cast, part):
    race = a_race(now)
    worse = drive(race, bob, laps(12_000, 12_000, 12_000), now).evaluation
    best = drive(race, bob, laps(10_000, 10_000, 10_000), now).evaluation
    for role, status in {"member": 200, "stranger": 404, "admin": 200, "anonymous": 404}.items():
        assert read(cast[role], best, part).status_code == 200, role
        assert read(cast[role], worse, part).status_code == status, role


def test_an_evaluation_needs_few_queries(bob, now, as_racer, django_assert_num_queries):
    evaluation, client = drive(a_race(now), bob, laps(10_000, 10_000, 10_000), now).evaluation, as_racer(None)
    with django_assert_num_queries(3):
        assert read(client, evaluation).status_code == 200


@pytest.fixture
def duel(alice, bob, now, wakes):
    """A finished race of Bob's car and Alice's, which retired."""
    evaluation = queue_evaluation(
        owner=bob,
        model=a_model(bob),
        rivals=[a_model(alice)],
        track=a_track(),
        rules=RaceRules(race_type="head_to_head"),
        now=now,
    )
    claimed = EVALUATIONS.claim(worker="w", now=now)
    layout = {"boxes": [BOX], "bots": [[[0.0, 0.0, 0.0]]]}
    outcome = outcome_of(rivals=[car_outcome(salt=1, retired="policy_died")], layout=layout)
    assert finish_evaluation(pk=claimed.pk, lease=claimed.lease, outcome=outcome, now=now)
    return evaluation


def test_every_car_of_a_run_has_its_result_and_files(alice, bob, duel, as_racer):
    client = as_racer(bob)
    shown = read(client, duel).data
    (rival,) = shown["rivals"]
    assert (rival["number"], rival["racer"], rival["model"]["public_id"]) == (
        1,
        "alice",
        duel.rivals.get().model.public_id,
    )
    result = shown["result"]
    assert (result["order"], result["retired"], result["boxes"]) == ([0, 1], None, [BOX])
    (other,) = result["rivals"]
    assert (other["number"], other["end_reason"], other["complete_laps"]) == (1, "retired", 1)
    assert (other["retired"]["code"], other["retired"]["fault"]) == ("policy_died", "user")
    assert "step 50" in other["retired"]["sentence"]

    assert read(client, duel, "layout/").json() == {"boxes": [BOX], "bots": [[[0.0, 0.0, 0.0]]]}
    trace = read(client, duel, "trace/?car=1")
    assert trace.content == trace_csv(salt=1)
    assert trace["Content-Disposition"] == f'attachment; filename="{duel.public_id}-car1-sim-trace.csv"'
    assert read(client, duel, "trace/?car=0").content == trace_csv()
    assert read(client, duel, "metrics/?car=1").json() == {"metrics": []}


@pytest.mark.parametrize("car", ["2", "-1", "x", "1.0", "9" * 30, "\u0661", ""])
def test_an_unknown_car_number_is_refused_naming_the_cars(bob, duel, as_racer, car):
    for part in ("trace", "metrics"):
        answer = read(as_racer(bob), duel, f"{part}/?car={car}")
        assert (answer.status_code, answer.json()["code"]) == (400, "car_number")
        assert answer.json()["params"] == {"car": car[:20], "known": "0, 1"}


def test_the_layout_of_an_empty_track_is_empty(bob, now, as_racer):
    evaluation = drive(a_race(now), bob, laps(11_000), now).evaluation
    assert read(as_racer(bob), evaluation, "layout/").json() == {"boxes": [], "bots": []}
    assert read(as_racer(bob), evaluation).data["result"]["boxes"] == []


def test_a_layout_is_visible_with_its_finished_evaluation(alice, bob, now, duel, as_racer):
    waiting = sent(bob, now).evaluation
    assert read(as_racer(bob), waiting, "layout/").status_code == 404
    assert read(as_racer(None), duel, "layout/").status_code == 404
