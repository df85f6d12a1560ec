"""``manage.py doctor``: what it finds, and that it fails when something needed is missing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import namedtuple
from io import StringIO

import pytest
from django.core.management import call_command
from django.utils import timezone

from config.management.commands import doctor as command
from config.operations import doctor
from core.jobs.kinds import all_kinds
from evaluation.running.proof import Proof
from evaluation.running.worker_nodes import SILENT_AFTER, beat_worker, order_workers, start_worker
from evaluation.sandbox.probe import Layer, SandboxReport
from paddock.simulator.engine import ENGINE_ID
from tests.shared import CHECKOUT
from training.golden.proof import prove as golden_runs

pytestmark = [pytest.mark.slow, pytest.mark.django_db]


def examine() -> tuple[int, dict]:
    """Exit status and the JSON report."""
    out = StringIO()
    try:
        call_command("doctor", "--json", stdout=out)
    except SystemExit as end:
        return end.code, json.loads(out.getvalue())
    return 0, json.loads(out.getvalue())


def finding(report, name):
    return next(found for found in report["findings"] if found["name"] == name)


def test_a_sound_installation_is_healthy():
    status, report = examine()
    assert (status, report["healthy"]) == (0, True)
    assert report["sandbox"]["sufficient"]
    assert finding(report, "migrations")["detail"] == "up to date"
    assert finding(report, "storage")["status"] == "ok"
    assert {found["status"] for found in report["findings"]} <= {"ok", "warn"}


def test_each_line_of_the_table_starts_with_its_status():
    out = StringIO()
    call_command("doctor", stdout=out)
    lines = [line for line in out.getvalue().splitlines() if line.startswith("  ")]
    assert len(lines) > 20
    assert {line.split()[0] for line in lines} <= {"ok", "warn"}
    assert out.getvalue().endswith("Paddock can run here.\n")


def test_a_host_below_the_sandbox_minimum_fails(monkeypatch):
    report = SandboxReport([Layer("Landlock", False, "not in this kernel")], 0, 2)
    monkeypatch.setattr(command, "probe", lambda: report)
    status, report = examine()
    assert (status, report["healthy"]) == (1, False)
    assert finding(report, "level")["status"] == "fail"
    assert finding(report, "Landlock") == {
        "area": "Sandbox",
        "name": "Landlock",
        "status": "warn",
        "detail": "not in this kernel",
    }


def test_a_sound_installation_passes_its_golden_runs(monkeypatch):
    monkeypatch.setattr(command, "prove", golden_runs)
    status, report = examine()
    assert finding(report, "golden runs") == {
        "area": "Exactness",
        "name": "golden runs",
        "status": "ok",
        "detail": f"exact: 3 of 3, {ENGINE_ID}",
    }
    assert report["proof"]["exact"] and status == 0


def test_differing_golden_runs_fail_with_names_and_advice(monkeypatch, settings):
    differs = Proof(ENGINE_ID, 3, 2, ("a duel",), "a duel: trace_sha256 of car 0 is this and was that")
    monkeypatch.setattr(command, "prove", lambda: differs)
    status, report = examine()
    found = finding(report, "golden runs")
    assert (status, found["status"]) == (1, "fail")
    assert found["detail"].startswith("2 of 3 are equal: workers here take no work. Install the versions")
    assert finding(report, "a duel")["detail"] == "differs"
    assert finding(report, "the first of them")["detail"] == differs.why
    settings.INEXACT_WORKERS = "allow"
    status, report = examine()
    assert (status, finding(report, "golden runs")["status"]) == (0, "warn")
    assert "work all the same" in finding(report, "golden runs")["detail"]


def test_no_golden_run_is_driven_below_the_sandbox_minimum(monkeypatch):
    monkeypatch.setattr(command, "probe", lambda: SandboxReport([Layer("Landlock", False, "none")], 0, 2))
    monkeypatch.setattr(command, "prove", lambda: pytest.fail("it was driven"))
    assert "not driven" in finding(examine()[1], "golden runs")["detail"]


def test_another_architecture_is_warned_that_nothing_is_pinned(monkeypatch):
    monkeypatch.setattr(doctor.platform, "machine", lambda: "aarch64")
    found = finding(examine()[1], "arithmetic")
    assert found["status"] == "warn" and "pinned for x86-64 with glibc only" in found["detail"]


def test_unwritable_storage_fails(settings, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    settings.STORAGES = {
        **settings.STORAGES,
        "default": {"BACKEND": "django.core.files.storage.FileSystemStorage", "OPTIONS": {"location": blocked}},
    }
    status, report = examine()
    assert status == 1
    assert finding(report, "storage")["status"] == "fail"


def test_an_uncompiled_camera_is_a_warning_with_advice(monkeypatch):
    monkeypatch.setattr(doctor.compiled, "load", lambda: None)
    status, report = examine()
    assert status == 0
    assert finding(report, "camera")["status"] == "warn"
    assert "gcc" in finding(report, "camera")["detail"] and "make setup" in finding(report, "camera")["detail"]


def test_little_disk_space_is_a_warning(monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda path: usage(10, 5, 5 * 2**20))
    status, report = examine()
    assert status == 0
    assert finding(report, "disk space") == {
        "area": "Files",
        "name": "disk space",
        "status": "warn",
        "detail": "5 MB free, make room",
    }


def test_a_missing_package_fails(monkeypatch):
    monkeypatch.setattr(doctor, "PACKAGES", ("no-such-package",))
    status, report = examine()
    assert status == 1
    assert finding(report, "no-such-package")["status"] == "fail"


def test_an_unreachable_database_or_broker_is_named(tmp_path):
    environment = {
        **os.environ,
        "DJANGO_SETTINGS_MODULE": "config.settings",
        "PADDOCK_DATA": str(tmp_path),
        "DATABASE_URL": "postgres://nobody@127.0.0.1:1/nothing",
        "CELERY_BROKER_URL": "redis://127.0.0.1:1/0",
    }
    done = subprocess.run(
        [sys.executable, "manage.py", "doctor", "--json"], cwd=CHECKOUT, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 1
    report = json.loads(done.stdout)
    assert finding(report, "postgresql")["status"] == "fail"
    assert finding(report, "broker")["status"] == "warn"
    assert finding(report, "workers")["detail"] == "not known before the database is: see above"
    assert "Traceback" not in done.stderr and "not ready" not in done.stderr, "it is told once, in the findings"


def test_a_missing_video_encoder_is_only_a_warning(monkeypatch, settings):
    from videos.services import worker as work

    assert finding(examine()[1], "encoder")["status"] == "ok"
    monkeypatch.setattr(work, "ENCODER", "no-such-encoder")
    status, report = examine()
    assert (status, finding(report, "encoder")["status"]) == (0, "warn")
    assert "no-such-encoder" in finding(report, "encoder")["detail"]
    settings.VIDEOS = False
    assert finding(examine()[1], "encoder")["status"] == "ok"


def of_queue(queue: str):
    (found,) = [each for each in doctor.queues() if each.name == queue]
    return found


@pytest.mark.parametrize("kind", all_kinds(), ids=lambda kind: kind.name)
def test_it_says_if_no_worker_takes_a_kind_of_job(kind, settings):
    settings.TRAINING = settings.VIDEOS = True
    what = str(kind.model._meta.verbose_name_plural)
    found = of_queue(kind.queue)
    assert found.status == "warn" and "nobody takes" in found.detail and what in found.detail
    start_worker(name="other@here", queues=["another"], processes=8)
    assert of_queue(kind.queue).status == "warn"
    start_worker(name="worker@here", queues=[kind.queue], processes=8)
    found = of_queue(kind.queue)
    assert found.status == "ok" and what in found.detail


def test_a_held_worker_is_named_and_no_warning():
    for name in ("one@here", "two@here"):
        start_worker(name=name, queues=["celery"], processes=8)
    order_workers(names=["one@here"], order="pause", now=timezone.now())
    assert of_queue("celery").status == "ok" and "1 paused or drained" in of_queue("celery").detail
    order_workers(names=["two@here"], order="drain", now=timezone.now())
    assert of_queue("celery").status == "ok" and "workers --resume" in of_queue("celery").detail


def test_what_is_switched_off_needs_no_worker(settings):
    settings.TRAINING = settings.VIDEOS = False
    assert [each.name for each in doctor.queues() if each.status == "ok"] == ["training", "videos"]


def test_a_dead_messenger_is_a_warning():
    start_worker(name="messenger@here", queues=["messages"], processes=8)
    beat_worker(name="messenger@here", now=timezone.now() - 2 * SILENT_AFTER)
    assert of_queue("messages").status == "warn"
