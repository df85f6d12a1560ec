"""``manage.py evaluate`` and ``verify``: the site's numbers without the site."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from io import BytesIO, StringIO

import pytest
from django.core.management import CommandError, call_command
from django.utils import timezone

from evaluation.garage.services import upload_model
from evaluation.models import Evaluation, Result
from evaluation.running import pipeline
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from league.house_cars.services import house_cars
from paddock.errors import PlatformFault, UserFault
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from races.management.commands import evaluate as command
from races.management.commands import verify as verifying
from tests.evaluation.stubs import outcome_of
from tests.rows import track_row
from tests.shared import CHECKOUT, CONSOLE_CAR, SHARED, needs_shared

CAR = house_cars()[0]
CAR_FILES = (str(CAR.onnx), str(CAR.metadata))


def evaluate(*arguments: str, **options) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of the command."""
    out, err = StringIO(), StringIO()
    try:
        call_command("evaluate", *arguments, stdout=out, stderr=err, **options)
    except SystemExit as end:
        return end.code, out.getvalue(), err.getvalue()
    return 0, out.getvalue(), err.getvalue()


def refuse(fault):
    def play(*args, **kwargs):
        raise fault

    return play


def verify(evaluation) -> tuple[int, str]:
    """The exit status of ``manage.py verify``, and what it says."""
    out = StringIO()
    try:
        call_command("verify", evaluation.public_id, stdout=out, stderr=StringIO())
    except CommandError as error:
        return error.returncode, out.getvalue() + str(error)
    return 0, out.getvalue()


class TestEvaluate:
    @pytest.mark.slow
    @needs_shared
    def test_a_console_car_laps_identically_without_a_database(self):
        track = SHARED / "tracks" / "reInvent2019_wide.npy"
        arguments = ["evaluate", str(CONSOLE_CAR), "--track", str(track), "--json"]
        environment = {
            **os.environ,
            "DATABASE_URL": "postgres://nobody@127.0.0.1:1/nothing",
            "CELERY_BROKER_URL": "redis://127.0.0.1:1/0",
        }
        reports = []
        for _ in range(2):
            done = subprocess.run(
                [sys.executable, "manage.py", *arguments], cwd=CHECKOUT, env=environment, capture_output=True, text=True
            )
            assert (done.returncode, done.stderr) == (0, "")
            reports.append(json.loads(done.stdout))
        first, second = reports
        assert [lap["episode_status"] for lap in first["metrics"]] == ["Lap complete"] * 3
        times = [lap["elapsed_time_in_milliseconds"] for lap in first["metrics"]]
        assert first["average_lap_ms"] == sum(times) // 3
        assert first["best_lap_ms"] == min(times)
        assert first["total_ms"] == sum(times) == round(first["simulated_seconds"] * 1000)
        assert first["engine"] == ENGINE_ID
        assert first["wall_seconds"] > 0
        same = ("metrics", "average_lap_ms", "best_lap_ms", "total_ms", "trace_sha256", "simulated_seconds", "versions")
        assert {key: first[key] for key in same} == {key: second[key] for key in same}

    def test_it_prints_a_readable_table(self):
        status, out, _ = evaluate(*CAR_FILES, "--track", "oval", "--laps", "1")
        assert status == 0
        assert out.startswith("Paddock Oval, ")
        assert "Lap complete" in out and "times real time" in out

    def test_options_reach_the_rules_and_the_trace_is_written(self, monkeypatch, tmp_path):
        jobs = []

        def play(job, **kwargs):
            jobs.append(job)
            return pipeline.evaluate(job, **kwargs)

        monkeypatch.setattr(command, "evaluate", play)
        trace = tmp_path / "trace.csv"
        arguments = ["--direction", "cw", "--laps", "1", "--seed", "7", "--off-track-penalty", "2.5"]
        arguments += ["--collision-penalty", "1", "--max-resets", "4", "--time-limit", "30", "--trace", str(trace)]
        arguments += ["--start", "2.5", "--ranking-method", "best", "--minimum-laps", "1"]
        status, out, _ = evaluate(*CAR_FILES, "--track", "oval", *arguments, "--json")
        assert status == 0
        assert jobs[0].rules == RaceRules(
            direction="cw",
            laps=1,
            seed=7,
            start_m=2.5,
            off_track_penalty_ms=2500,
            collision_penalty_ms=1000,
            max_resets=4,
            max_simulated_ms=30_000,
        )
        assert jobs[0].track.direction == "cw"
        told = json.loads(out)
        assert told["classified"] and told["score_ms"] == told["best_lap_ms"]
        assert len(trace.read_text().splitlines()) == 2 + json.loads(out)["steps"]  # a header, and the state at the end

    @pytest.mark.parametrize(
        ("content", "code"), [(b"", "empty"), (b"<html>", "not_a_model"), (b"\x1f\x8b broken", "archive_corrupt")]
    )
    def test_a_refused_package_exits_2_with_its_code(self, tmp_path, content, code):
        package = tmp_path / "car.tar.gz"
        package.write_bytes(content)
        status, out, err = evaluate(str(package), "--track", "oval")
        assert (status, out) == (2, "")
        assert err.startswith(f"{code}: ")
        status, out, err = evaluate(str(package), "--track", "oval", "--json")
        assert status == 2
        assert json.loads(out)["error"]["code"] == code
        assert err.startswith(f"{code}: ")

    def test_a_refused_track_exits_2_with_its_code(self, tmp_path):
        track = tmp_path / "track.npy"
        track.write_bytes(b"no numbers")
        status, _, err = evaluate(*CAR_FILES, "--track", str(track))
        assert (status, err.split(":")[0]) == (2, "track_not_npy")

    def test_a_fault_of_the_model_exits_2_and_ours_3(self, monkeypatch):
        fault = UserFault("policy_died", step=3, how="signal 11")
        fault.add_note("what our processes said")
        monkeypatch.setattr(command, "evaluate", refuse(fault))
        status, out, err = evaluate(*CAR_FILES, "--track", "oval")
        assert (status, out) == (2, "") and err.startswith("policy_died: ") and "our processes" not in err
        assert "what our processes said" in evaluate(*CAR_FILES, "--track", "oval", verbosity=2)[2]
        fault = PlatformFault("sandbox_unavailable", level=0, minimum=2)
        fault.add_note("Landlock is missing")
        monkeypatch.setattr(command, "evaluate", refuse(fault))
        status, out, err = evaluate(*CAR_FILES, "--track", "oval", "--json")
        assert status == 3
        assert json.loads(out)["error"]["fault"] == "platform"
        assert "Landlock is missing" in err and "sandbox_unavailable: " in err

    @pytest.mark.django_db
    @pytest.mark.parametrize(
        ("arguments", "says"),
        [
            ((*CAR_FILES, "--track", "nowhere"), "There is no track nowhere"),
            ((*CAR_FILES, "--track", "missing.npy"), "missing.npy cannot be read: No such file"),
            (("missing.onnx", "--track", "oval"), "missing.onnx cannot be read: No such file"),
            ((*CAR_FILES, "--track", "oval", "--laps", "0"), "laps must be a whole number of at least 1"),
            ((*CAR_FILES, "--track", "oval", "--time-limit", "inf"), "time_limit must be a number of seconds, not inf"),
            ((*CAR_FILES, "--track", "oval", "--off-track-penalty", "nan"), "off_track_penalty must be a number"),
            ((*CAR_FILES, "--track", "oval", "--collision-penalty", "-1"), "collision_penalty_ms must be a whole"),
        ],
    )
    def test_invalid_arguments_are_explained(self, arguments, says):
        with pytest.raises(CommandError, match=says) as caught:
            evaluate(*arguments)
        assert caught.value.returncode == 2

    def test_figures_are_printed_even_if_the_trace_cannot_be_written(self, monkeypatch):
        monkeypatch.setattr(command, "evaluate", lambda job, **kwargs: outcome_of())
        out = StringIO()
        arguments = (*CAR_FILES, "--track", "oval", "--laps", "1", "--trace", "/no/such/folder/x", "--json")
        with pytest.raises(CommandError, match="cannot be written") as caught:
            call_command("evaluate", *arguments, stdout=out)
        assert caught.value.returncode == 1
        assert json.loads(out.getvalue())["end_reason"]


@pytest.mark.django_db(transaction=True)
class TestVerify:
    @pytest.fixture
    def evaluation(self, alice):
        """A real one, run by the worker's code."""
        files = [UploadPart(path.name, BytesIO(path.read_bytes())) for path in (CAR.onnx, CAR.metadata)]
        model = upload_model(owner=alice, files=files, now=timezone.now()).model
        evaluation = queue_evaluation(
            owner=alice, model=model, track=track_row("oval"), rules=RaceRules(laps=2), now=timezone.now()
        )
        assert run_next_evaluation(worker="w")
        evaluation.refresh_from_db()
        assert evaluation.state == "finished", evaluation.operator_detail
        return evaluation

    def test_site_command_line_and_a_second_run_agree(self, evaluation):
        result = evaluation.result
        status, out, _ = evaluate(*CAR_FILES, "--track", "oval", "--laps", "2", "--json")
        assert status == 0
        assert json.loads(out)["trace_sha256"] == result.trace_sha256
        assert json.loads(out)["metrics"] == result.metrics["metrics"]
        assert result.complete_laps == 2
        assert len(result.trajectory) == 2
        assert verify(evaluation) == (
            0,
            f"Evaluation {evaluation.public_id} is the same: engine {result.engine}, trace {result.trace_sha256}\n",
        )

    def test_differences_are_named(self, evaluation):
        Result.objects.update(trace_sha256="0" * 64, cpu_model="another", versions={"numpy": "1"})
        status, said = verify(evaluation)
        assert status == 1
        assert f"both runs are of the engine {evaluation.result.engine}" in said
        assert f"trace_sha256: was {'0' * 64}, is " in said
        assert "version of numpy: was 1, is " in said
        assert "version of pybullet: was None, is " in said
        assert "lap times" not in said
        assert "(processor: was another, is " in said

    def test_a_result_of_another_engine_is_reported_and_not_run(self, evaluation, monkeypatch):
        monkeypatch.setattr(verifying, "evaluate", refuse(AssertionError("it was run")))
        Result.objects.update(engine="paddock-v0")
        status, said = verify(evaluation)
        assert (status, "different" in said) == (3, False)
        assert f"is of the engine paddock-v0, and this site drives with {ENGINE_ID}" in said

    def test_a_different_ending_differs_and_our_fault_is_neither(self, evaluation, monkeypatch):
        monkeypatch.setattr(verifying, "evaluate", refuse(UserFault("policy_died", step=3, how="signal 11")))
        status, said = verify(evaluation)
        assert (status, "policy_died" in said) == (1, True)
        monkeypatch.setattr(verifying, "evaluate", refuse(PlatformFault("storage_failed")))
        assert verify(evaluation)[0] == 3

    def test_only_runs_with_results_can_be_verified(self, evaluation):
        queued = Evaluation.objects.create(
            owner=evaluation.owner, model=evaluation.model, track=evaluation.track, spec=evaluation.spec
        )
        assert verify(queued) == (3, f"Evaluation {queued.public_id} has no result: it is queued.")
        queued.public_id = "unknown"
        assert verify(queued) == (3, "There is no evaluation unknown.")
