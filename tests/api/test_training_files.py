"""What a program does beside a training: try its reward function, drive its model in private, take its files home."""

from __future__ import annotations

import io
import zipfile

import pytest
from django.core.cache import cache
from django.test import Client

from evaluation.models import Evaluation
from tests.factories import a_racer, a_track
from tests.training.jobs import REWARD, a_trained_one, a_training
from training.jobs.services.queue import stop_training
from training.models import TrainingJob

pytestmark = pytest.mark.django_db
CHECK = "/api/v1/reward-functions/validate/"
FILES = ("package/", "package/?model=last", "sb3/", "logs/", "trace/")


@pytest.fixture
def job(alice, now, trainings_taken_on) -> TrainingJob:
    return a_trained_one(alice, a_track(), now)


def address(job: TrainingJob, part: str = "") -> str:
    return f"/api/v1/trainings/{job.public_id}/{part}"


def test_the_files_of_a_training_can_be_downloaded(alice, as_racer, job):
    client = as_racer(alice)
    package = client.get(address(job, "package/"))
    assert package["Content-Disposition"] == f'attachment; filename="{job.best_model.name.replace(" ", "-")}.zip"'
    assert set(zipfile.ZipFile(io.BytesIO(package.content)).namelist()) == {"model.onnx", "model_metadata.json"}
    assert client.get(address(job, "package/?model=last")).content != package.content
    assert client.get(address(job, "sb3/")).content == b"PK-sb3"
    logs = zipfile.ZipFile(io.BytesIO(client.get(address(job, "logs/")).getvalue()))
    assert "reward_function.py" in logs.namelist()
    trace = client.get(address(job, "trace/"), headers={"Accept": "text/csv"})
    assert (trace["Content-Type"], trace.content) == ("text/csv; charset=utf-8", b"episode,steps\n0,1\n")


def test_pickles_of_another_racer_come_with_a_warning(alice, cast, as_racer, job, now):
    mine, theirs = as_racer(alice).get(address(job, "sb3/")), cast["admin"].get(address(job, "sb3/"))
    assert mine["Content-Type"] == theirs["Content-Type"] == "application/octet-stream"
    assert "UNTRUSTED" not in mine["Content-Disposition"]
    assert theirs["Content-Disposition"].startswith('attachment; filename="UNTRUSTED-alice-')
    assert theirs["X-Content-Type-Options"] == "nosniff"
    assert as_racer(alice).get(address(job, "sb3/"), headers={"Accept": "application/zip"}).status_code == 200
    stop_training(job=job, now=now)  # its page then has the files
    for racer, warned in ((alice, False), (a_racer(is_staff=True), True)):
        browser = Client()
        browser.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
        assert ('id="untrusted"' in browser.get(job.get_absolute_url()).content.decode()) is warned


def test_files_that_do_not_exist_yet_are_not_found(alice, as_racer, now, trainings_taken_on):
    job = a_training(alice, a_track(), now)
    for part in set(FILES) - {"logs/"}:
        answer = as_racer(alice).get(address(job, part))
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), part
    assert as_racer(alice).get(address(job, "package/?model=worst")).status_code == 400


def test_only_the_owner_and_admins_get_training_files(cast, job):
    for role, client in cast.items():
        expected = {"owner": 200, "admin": 200, "anonymous": 401}.get(role, 404)
        for part in FILES:
            assert client.get(address(job, part)).status_code == expected, (role, part)


def test_a_training_model_is_evaluated_privately(alice, cast, job):
    made = cast["owner"].post(address(job, "evaluations/"), {"model": "last"})
    assert made.status_code == 201, made.data
    evaluation = Evaluation.objects.get()
    assert (evaluation.public_id, evaluation.model, evaluation.owner) == (made.data["public_id"], job.last_model, alice)
    assert (made.data["race"], made.data["rules"]["laps"]) == (None, 3)
    for role, client in cast.items():
        expected = 200 if role in ("owner", "admin") else 404
        assert client.get(f"/api/v1/evaluations/{evaluation.public_id}/").status_code == expected, role
    cast["owner"].post(address(job, "evaluations/"))
    assert Evaluation.objects.latest("pk").model == job.best_model


def test_only_the_owner_evaluates_a_training_model(cast, job):
    hidden = dict.fromkeys(("member", "stranger", "admin"), (404, "not_found"))
    for role, refusal in (hidden | {"anonymous": (401, "not_authenticated")}).items():
        answer = cast[role].post(address(job, "evaluations/"))
        assert (answer.status_code, answer.data["code"]) == refusal, role
    assert not Evaluation.objects.exists()


def test_a_training_without_a_model_cannot_be_evaluated(alice, as_racer, now, trainings_taken_on):
    job = a_training(alice, a_track(), now)
    answer = as_racer(alice).post(address(job, "evaluations/"))
    assert (answer.status_code, answer.data["code"]) == (409, "training_no_model")
    assert as_racer(alice).post(address(job, "evaluations/"), {"model": "worst"}).status_code == 400


def test_a_reward_function_is_checked_as_in_the_wizard(alice, as_racer):
    client = as_racer(alice)
    good = client.post(CHECK, {"reward_code": REWARD.replace("\n", "\r\n")}).data
    assert good["valid"] and good["problems"] == [] and good["rewards"]["start"] > 0
    bad = client.post(CHECK, {"reward_code": "def reward_function(params):\n    return params['speed'] / 0\n"}).data
    (problem,) = {(each["code"], each["line"], each["kind"]) for each in bad["problems"]}
    assert not bad["valid"] and problem == ("reward_raised", 2, "test")
    empty = client.post(CHECK, {"reward_code": ""}).data
    assert (empty["valid"], empty["problems"][0]["code"]) == (False, "reward_length")
    assert client.post(CHECK, {"reward_code": REWARD, "race_type": "hurdles"}).status_code == 400
    assert as_racer(None).post(CHECK, {"reward_code": REWARD}).status_code == 401


def test_a_racer_runs_one_check_at_a_time(alice, as_racer):
    cache.add(f"reward-check-{alice.pk}", 1)
    answer = as_racer(alice).post(CHECK, {"reward_code": REWARD})
    assert (answer.status_code, answer.data["code"]) == (409, "reward_check_runs")
