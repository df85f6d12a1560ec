"""Reports as workers drive them: real simulator, real network, real sandbox; and one worker that is killed."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from django.utils import timezone

from evaluation.garage.services import upload_model
from evaluation.models import State
from evaluation.models.reports import CarReport
from evaluation.reports import planning
from evaluation.reports.jobs import run_next_chunk
from evaluation.reports.services import drive_report_again
from paddock.packages.read import UploadPart
from tests.evaluation.processes import environment, kill_session
from tests.evaluation.reports import a_report
from tests.shared import CHECKOUT
from tests.wakeups import heard

HOUSE_CARS = CHECKOUT / "training" / "house_cars"


def flyer_of(racer):
    with (HOUSE_CARS / "flyer.onnx").open("rb") as onnx, (HOUSE_CARS / "flyer.json").open("rb") as metadata:
        parts = [UploadPart("flyer.onnx", onnx), UploadPart("model_metadata.json", metadata)]
        return upload_model(owner=racer, files=parts, now=timezone.now()).model


def start_worker(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.evaluation.report_worker", *arguments],
        cwd=CHECKOUT,
        env=environment("redis://127.0.0.1:1/0"),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def results(report: CarReport) -> list[tuple]:
    return list(report.laps.order_by("number").values_list("complete", "time_ms", "percent", "x", "y", "trace_sha256"))


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
@pytest.mark.xdist_group("workers")
def test_one_worker_or_two_of_which_one_is_killed_come_to_the_same_report(alice, oval, wakes, monkeypatch):
    heard(monkeypatch, "evaluation.tasks.drive_reports")
    monkeypatch.setattr(planning, "VARIATIONS", 7)
    monkeypatch.setattr(planning, "MOST_IN_CHUNK", 3)
    first = a_report(alice, timezone.now(), model=flyer_of(alice))
    while run_next_chunk(worker="alone"):
        pass
    first.refresh_from_db()
    assert first.state == State.FINISHED and first.laps.filter(complete=None).count() == 0

    second = drive_report_again(report=first, now=timezone.now())
    workers = [start_worker("2"), start_worker()]
    try:
        said = [worker.communicate(timeout=120)[0].decode() for worker in workers]
    finally:
        for worker in workers:
            kill_session(worker.pid)
    assert workers[0].returncode == -signal.SIGKILL, said
    assert workers[1].returncode == 0, said
    second.refresh_from_db()
    assert second.state == State.FINISHED
    assert max(second.chunks.values_list("attempt", flat=True)) == 2
    assert results(second) == results(first) and second.runs_sha256 == first.runs_sha256
    assert second.chunks.filter(state=State.FINISHED).count() == 3
