"""Commands for what is yours on a site, against a running site: models, runs, submissions, trainings, logs, videos."""

from __future__ import annotations

import io
import shutil
import sys
import zipfile

import pytest
from django.utils import timezone

from evaluation.models import Evaluation, TrainedModel
from evaluation.running.queue.worker import run_next_evaluation
from paddock.cli import asking
from races.models import Entry
from tests.drawn_runs import a_drawing
from tests.factories import a_track
from tests.paddock.cli.test_against_a_site import CAR, OTHER
from tests.shared import CONSOLE_CAR, needs_shared
from tests.training.jobs import REWARD, SHORT_TRAINING, a_training
from training.jobs.services.worker import run_next_training
from training.models import JobState, TrainingJob
from videos import drawing
from videos.models import Video
from videos.services import run_next_video

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True), pytest.mark.usefixtures("site")]


@pytest.fixture
def videos(video_wakes, monkeypatch):
    """A worker draws a video of a few bytes while a command waits."""
    monkeypatch.setattr(drawing, "write_video", a_drawing)
    monkeypatch.setattr(drawing, "poster", lambda scene: b"a still")
    monkeypatch.setattr(asking.time, "sleep", lambda _: run_next_evaluation(worker="w") or run_next_video(worker="w"))


def test_a_model_is_uploaded_listed_renamed_downloaded_and_deleted(paddock, log_in, tmp_path):
    log_in("alice")
    made = paddock("models", "upload", *CAR, "--name", "Bolt", "--json").json["public_id"]
    assert paddock("models", "list").out.split("\n")[1].startswith(made)
    assert [one["name"] for one in paddock("models", "list", "--search", "bol", "--json").json] == ["Bolt"]
    assert paddock("models", "list", "--search", "nothing").out == "No models.\n"
    assert "Bolt" in paddock("models", "show", made).out
    renamed = paddock("models", "rename", "Bolt", "Flash", "--json")
    assert renamed.json["name"] == "Flash" == TrainedModel.objects.get().name
    assert (paddock("models", "show", "Bolt").status, paddock("models", "show", "Bolt").code) == (
        2,
        "home_model_unknown",
    )
    for form in ("package", "upload", "car", "openvino"):
        assert paddock("models", "download", "Flash", tmp_path / form, "--form", form).status == 0
        assert (tmp_path / form).stat().st_size > 1000
    assert paddock("models", "download", made, tmp_path / "car").code == "home_exists"
    kept = paddock("models", "delete", made)
    assert (kept.status, kept.code) == (2, "home_not_confirmed")
    assert paddock("models", "delete", made, "--yes").status == 0
    assert paddock("models", "list", "--json").json == []


def test_a_folder_of_models_is_uploaded_and_raced(paddock, log_in, race, tmp_path):
    log_in("alice")
    for onnx, metadata in (CAR, OTHER):
        shutil.copy(onnx, tmp_path / onnx.name)
        shutil.copy(metadata, tmp_path / f"{onnx.stem}.json")
    (tmp_path / "broken.zip").write_bytes(b"no zip")
    said = paddock("models", "upload", tmp_path, "--json")
    assert (said.status, said.json["done"], said.json["failed"]) == (1, 2, 1)
    assert sorted(TrainedModel.objects.values_list("name", flat=True)) == ["brisk", "flyer"]
    (tmp_path / "broken.zip").unlink()
    said = paddock("submissions", "submit", tmp_path, "open")
    assert said.status == 0, said.err
    assert "2 models: 2 done, 0 failed" in said.out
    assert Evaluation.objects.filter(state="finished").count() == 2


def test_a_private_run_from_start_to_its_files(paddock, log_in, race, tmp_path):
    log_in("alice")
    started = paddock("runs", "start", *CAR, "--track", "oval", "--rule", "laps=1", "--wait", "--json")
    assert started.status == 0, started.err
    run = started.json["public_id"]
    assert started.json["state"] == "finished" and started.json["own"] is not None
    assert run in paddock("runs", "list").out
    assert paddock("runs", "list", "--state", "failed", "--json").json == []
    assert "best 0:" in paddock("runs", "show", run).out
    assert paddock("runs", "wait", run).status == 0
    for what in ("trace", "metrics", "logs"):
        assert paddock("runs", "download", run, tmp_path / what, "--what", what).status == 0
    assert b"lap_complete" in (tmp_path / "trace").read_bytes()
    assert zipfile.is_zipfile(tmp_path / "logs")
    assert paddock("logs", run, tmp_path / "all.zip").status == 0
    assert paddock("runs", "delete", run).code == "home_not_confirmed"
    assert paddock("runs", "delete", run, "--yes").status == 0
    assert paddock("runs", "show", run).code == "not_on_site"


def test_a_run_as_in_a_race_and_a_stopped_one(paddock, log_in, race, site):
    log_in("alice")
    model = paddock("upload", *CAR, "--json").json["public_id"]
    run = paddock("runs", "start", model, "--race", f"{site}/races/open/", "--json").json
    assert (run["state"], run["own"]["race"]["slug"]) == ("queued", "open")
    assert "stopped" in paddock("runs", "stop", run["public_id"]).out
    assert paddock("runs", "wait", run["public_id"]).status == 1
    wrong = paddock("runs", "start", model, "--track", "oval", "--rule", "wings=2")
    assert (wrong.status, wrong.code) == (2, "invalid")
    assert Evaluation.objects.count() == 1


def test_a_lost_answer_starts_one_run(paddock, log_in, race, monkeypatch):
    """Each try has the same key, so the site creates one run."""
    from paddock.cli.site import Site
    from paddock.errors import PlatformFault

    log_in("alice")
    model = paddock("upload", *CAR, "--json").json["public_id"]
    once, keys = Site._once, []

    def lossy(self, method, path, data, headers):
        answer = once(self, method, path, data, headers)
        if method == "POST":
            keys.append(headers["Idempotency-Key"])
            if len(keys) == 1:
                raise PlatformFault("site_unreachable", site=self.address, problem="lost")
        return answer

    monkeypatch.setattr(Site, "_once", lossy)
    paddock("runs", "start", model, "--track", "oval")
    assert len(keys) == 2 and len(set(keys)) == 1


def test_submissions_are_listed_and_withdrawn(paddock, log_in, race):
    log_in("alice")
    assert paddock("submissions", "list").out == "No submissions.\n"
    assert paddock("submissions", "submit", *CAR, "open", "--wait").status == 0
    for arguments in (("open",), ()):
        (one,) = paddock("submissions", "list", *arguments, "--json").json
        assert (one["race"], one["state"], one["is_best"]) == ("open", "finished", True)
    assert "open" in paddock("submissions", "list").out
    assert paddock("submissions", "withdraw", "open").code == "home_not_confirmed"
    assert paddock("submissions", "withdraw", "open", "--yes").status == 0
    assert Entry.objects.get().withdrawn_at is not None


def test_a_video_is_made_and_downloaded(paddock, log_in, race, videos, tmp_path):
    log_in("alice")
    run = paddock("runs", "start", *CAR, "--track", "oval", "--rule", "laps=1", "--wait", "--json").json["public_id"]
    assert paddock("video", run, tmp_path / "best.mp4").status == 0
    assert (tmp_path / "best.mp4").stat().st_size
    assert paddock("video", run, tmp_path / "best.mp4").code == "home_exists"
    assert paddock("video", run, tmp_path / "again.mp4").status == 0
    assert Video.objects.count() == 1
    assert paddock("video", run, tmp_path / "no.mp4", "--part", "7").status == 2


def test_a_training_is_started_with_settings_and_stopped(paddock, log_in, trainings_taken_on, tmp_path):
    log_in("alice")
    a_track()
    (tmp_path / "first_car.py").write_text(REWARD)
    (tmp_path / "settings.json").write_text('{"stop_minutes": 5, "hyperparameters": {"lr": 0.001}}')
    arguments = ("train", "start", tmp_path / "first_car.py", "--track", "oval")
    more = ("--settings", tmp_path / "settings.json", "--set", "hyperparameters.discount_factor=0.97")
    job = paddock(*arguments, *more, "--json").json
    assert (job["name"], job["state"], job["stop_minutes"]) == ("first-car", "queued", 5)
    assert (job["hyperparameters"]["lr"], job["hyperparameters"]["discount_factor"]) == (0.001, 0.97)
    assert job["public_id"] in paddock("train", "list").out
    assert "first-car: queued" in paddock("train", "show", job["public_id"]).out
    late = paddock("train", "watch", job["public_id"], "--timeout", "0")
    assert (late.status, late.code) == (3, "wait_over")
    assert "stopped" in paddock("train", "stop", job["public_id"]).out
    assert TrainingJob.objects.get().state == JobState.STOPPED
    assert "stopped" in paddock("train", "watch", job["public_id"]).out
    (tmp_path / "bad.py").write_text("import os\n")
    refused = paddock("train", "start", tmp_path / "bad.py", "--track", "oval")
    assert refused.status == 2 and refused.code.startswith("reward_")
    assert paddock("train", "start", tmp_path / "none.py", "--track", "oval").code == "home_file_unreadable"
    assert paddock("train", "start", tmp_path / "bad.py").code == "home_command_line"


@pytest.mark.xdist_group("training")
def test_a_training_is_watched_to_its_end_and_its_logs_are_downloaded(
    paddock, log_in, trainings_taken_on, monkeypatch, tmp_path
):
    pytest.importorskip("torch", reason="training is not installed: make training")
    alice = log_in("alice")
    job = a_training(alice, a_track(), timezone.now(), **SHORT_TRAINING)
    monkeypatch.setattr(asking.time, "sleep", lambda _: run_next_training(worker="w"))
    said = paddock("logs", job.public_id, tmp_path / "logs.zip", "--follow")
    assert said.status == 0, said.err
    assert "iteration 1:" in said.err
    assert any(name.endswith(".csv") for name in zipfile.ZipFile(tmp_path / "logs.zip").namelist())
    assert "finished" in paddock("train", "watch", job.public_id).out


def test_a_token_without_the_scope_is_refused_in_the_words_of_the_site(paddock, log_in, trainings_taken_on, tmp_path):
    log_in("alice", ("read",))
    (tmp_path / "reward.py").write_text(REWARD)
    said = paddock("train", "start", tmp_path / "reward.py", "--track", "oval")
    assert (said.status, said.code) == (2, "scope_missing")


@needs_shared
def test_a_model_of_the_console_runs_on_the_site(paddock, log_in, race, tmp_path):
    log_in("alice")
    shutil.copy(CONSOLE_CAR, tmp_path / "model.tar.gz")
    said = paddock("models", "upload", tmp_path, "--json")
    assert said.status == 0, said.err
    (row,) = said.json["models"]
    run = paddock(
        "runs", "start", row["result"]["public_id"], "--track", "oval", "--rule", "laps=1", "--wait", "--json"
    )
    assert run.json["state"] == "finished"


def test_an_interruption_ends_quietly(paddock, log_in, race, monkeypatch):
    log_in("alice")
    monkeypatch.setattr(asking.time, "sleep", _interrupt)
    said = paddock("runs", "start", *CAR, "--track", "oval", "--wait")
    assert said.status == 130 and "Interrupted" in said.err and "Traceback" not in said.err


def _interrupt(_: float) -> None:
    raise KeyboardInterrupt


def test_deleting_asks_on_a_terminal(paddock, log_in, monkeypatch):
    log_in("alice")
    paddock("upload", *CAR, "--name", "Bolt")

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for answer, left in (("n\n", 1), ("y\n", 0)):
        monkeypatch.setattr(sys, "stdin", Terminal(answer))
        paddock("models", "delete", "Bolt")
        assert len(paddock("models", "list", "--json").json) == left
