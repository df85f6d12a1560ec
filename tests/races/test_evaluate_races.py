"""``manage.py evaluate`` and ``verify``: boxes, bots and other cars."""

from __future__ import annotations

import json
from io import BytesIO

import pytest
from django.core.management import CommandError
from django.utils import timezone

from evaluation.garage.services import upload_model
from evaluation.models import Result, RivalResult
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.running.results import read_layout
from league.house_cars.services import house_cars
from paddock.packages.read import UploadPart
from paddock.rules.race import BoxPlace, RaceRules
from races.management.commands import evaluate as command
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.races.test_evaluate import CAR, CAR_FILES, evaluate, verify
from tests.rows import track_row

OTHER = house_cars()[1]
RIVAL = f"{OTHER.onnx},{OTHER.metadata}"
AVOID = ("--race-type", "object_avoidance")
DUEL = ("--race-type", "head_to_head")
BOX = {"fraction": 0.5, "lane": "inner", "x": 1.0, "y": 2.0, "yaw": 0.25}


@pytest.fixture
def jobs(monkeypatch):
    """The jobs that the command hands to a pipeline that only plays."""
    seen = []

    def play(job, **kwargs):
        seen.append(job)
        rivals = [car_outcome(salt=number, retired="policy_died") for number, _ in enumerate(job.rivals, 1)]
        layout = {"boxes": [BOX], "bots": [[[0.0, 0.0, 0.0]]] * job.rules.bots}
        return outcome_of(rivals=rivals, layout=layout, order=[*range(len(rivals), -1, -1)])

    monkeypatch.setattr(command, "evaluate", play)
    return seen


def drive(*arguments, json_=True):
    status, out, err = evaluate(*CAR_FILES, "--track", "oval", *arguments, *(["--json"] if json_ else []))
    assert (status, err) == (0, "")
    return json.loads(out) if json_ else out


class TestOptions:
    def test_boxes_are_drawn_from_the_seed(self, jobs):
        drive(*AVOID, "--obstacles", "6", "--obstacle-distance", "1.5", "--seed", "7")
        assert jobs[0].rules == RaceRules(race_type="object_avoidance", random_boxes=6, box_distance_m=1.5, seed=7)

    def test_boxes_stay_where_they_are_placed(self, jobs):
        drive(*AVOID, "--box", "0.25:inner", "--box", "0.5:outer")
        boxes = (BoxPlace(0.25, "inner"), BoxPlace(0.5, "outer"))
        assert jobs[0].rules == RaceRules(race_type="object_avoidance", boxes=boxes)

    def test_bots_drive_as_configured(self, jobs):
        drive(*DUEL, "--bots", "4", "--bot-speed", "1.5", "--lane-changes")
        assert jobs[0].rules == RaceRules(race_type="head_to_head", bots=4, bot_speed_mps=1.5, bot_lane_changes=True)

    def test_rivals_are_read_like_the_first_car(self, jobs):
        drive(*DUEL, "--rival", RIVAL, "--rival", ",".join(CAR_FILES))
        (job,) = jobs
        assert [rival.onnx == job.onnx for rival in job.rivals] == [False, True]
        assert job.rivals[1].metadata == job.metadata

    def test_a_head_to_head_car_may_drive_alone(self, jobs):
        drive(*DUEL)
        assert jobs[0].rules == RaceRules(race_type="head_to_head")


class TestReport:
    def test_every_car_has_its_number_and_figures(self, jobs, tmp_path):
        report = drive(*DUEL, "--rival", RIVAL, "--trace", str(tmp_path / "run.csv"))
        assert report["order"] == [1, 0]
        assert report["crashes"] == 0 and report["retired"] is None
        (rival,) = report["rivals"]
        assert rival["retired"]["code"] == "policy_died"
        assert "step 50 (SIGSEGV)" in rival["retired"]["message"]
        assert rival["end_reason"] == "retired"
        assert rival["trace_sha256"] != report["trace_sha256"]
        assert rival["model_sha256"] != report["model_sha256"]
        assert sorted(path.name for path in tmp_path.iterdir()) == ["run-car1.csv", "run.csv"]

    def test_the_layout_is_reported_with_its_seed(self, jobs):
        first = drive(*DUEL, "--bots", "2")
        assert first["layout"] == {"boxes": [BOX], "bots": 2}
        assert first["rivals"] == [] and first["order"] == [0]
        assert first["layout_sha256"] == drive(*DUEL, "--bots", "2")["layout_sha256"]
        assert first["layout_sha256"] != drive(*DUEL, "--bots", "3")["layout_sha256"]

    def test_the_table_names_each_car_and_its_place(self, jobs):
        out = drive(*DUEL, "--rival", RIVAL, json_=False)
        assert "car 0, place 2" in out and "car 1, place 1" in out
        assert "retired: policy_died: " in out


class TestBadInput:
    @pytest.mark.parametrize(
        ("arguments", "code"),
        [
            (AVOID, "race_needs_boxes"),
            ((*AVOID, "--obstacles", "11"), "race_too_many_boxes"),
            ((*AVOID, "--obstacles", "-1"), "race_needs_boxes"),
            ((*AVOID, "--obstacles", "2", "--box", "0.5:inner"), "race_boxes_fixed_or_random"),
            ((*AVOID, "--box", "0.5:middle"), "race_boxes_shape"),
            ((*AVOID, "--box", "0.5"), "race_boxes_shape"),
            ((*AVOID, "--box", "half:inner"), "race_boxes_shape"),
            ((*AVOID, "--box", "nan:inner"), "race_boxes_shape"),
            ((*AVOID, "--box", "1:inner"), "race_boxes_shape"),
            ((*AVOID, "--box=-0.1:inner"), "race_boxes_shape"),
            ((*AVOID, "--box", "0.01:inner"), "box_on_start_line"),
            ((*AVOID, "--box", "0.5:inner", "--box", "0.51:outer"), "boxes_overlap"),
            ((*AVOID, "--obstacles", "10", "--obstacle-distance", "9"), "boxes_do_not_fit"),
            (("--obstacles", "6"), "race_has_no_boxes"),
            ((*DUEL, "--box", "0.5:inner"), "race_has_no_boxes"),
            ((*AVOID, "--obstacles", "6", "--bots", "1"), "race_has_no_opponents"),
            (("--bot-speed", "1"), "race_has_no_opponents"),
            (("--lane-changes",), "race_has_no_opponents"),
            ((*DUEL, "--lane-changes"), "race_bot_count"),
            ((*DUEL, "--bots", "7"), "race_bot_count"),
            ((*DUEL, "--bots", "-1"), "race_bot_count"),
            ((*DUEL, "--bots", "1", "--bot-speed", "4.1"), "race_bot_speed"),
            ((*DUEL, "--bots", "1", "--bot-speed", "0.1"), "race_bot_speed"),
            ((*DUEL, "--bots", "1", "--bot-speed", "nan"), "race_bot_speed"),
            (("--start", "999"), "own_start"),
            (("--laps", "2", "--minimum-laps", "3"), "race_minimum_laps"),
            (("--ranking-method", "total", "--minimum-laps", "1"), "race_total_needs_all_laps"),
            (("--rival", RIVAL), "rivals_race_type"),
            ((*DUEL, "--bots", "1", "--rival", RIVAL), "rivals_with_bots"),
            ((*DUEL, *["--rival", RIVAL] * 4), "too_many_rivals"),
        ],
        ids=str,
    )
    def test_an_impossible_layout_is_refused_with_its_code(self, jobs, arguments, code):
        status, out, err = evaluate(*CAR_FILES, "--track", "oval", *arguments, "--json")
        assert status == 2
        assert json.loads(out)["error"]["code"] == code
        assert err.startswith(f"{code}: ") and "?" not in err
        assert not jobs

    @pytest.mark.parametrize(
        ("arguments", "says"),
        [
            ((*DUEL, "--rival", "missing.tar.gz"), "missing.tar.gz cannot be read"),
            ((*DUEL, "--rival", "missing.onnx,missing.json"), "missing.onnx cannot be read"),
            ((*AVOID, "--obstacles", "6", "--obstacle-distance", "-1"), "box_distance_m must be a number"),
            (("--start=-1",), "start_m must be a number"),
        ],
    )
    def test_invalid_arguments_are_explained(self, jobs, arguments, says):
        with pytest.raises(CommandError, match=says):
            evaluate(*CAR_FILES, "--track", "oval", *arguments)

    def test_an_invalid_rival_is_refused_like_any_upload(self, jobs, tmp_path):
        package = tmp_path / "rival.tar.gz"
        package.write_bytes(b"<html>")
        status, out, _ = evaluate(*CAR_FILES, "--track", "oval", *DUEL, "--rival", str(package), "--json")
        assert (status, json.loads(out)["error"]["code"]) == (2, "not_a_model")


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
class TestSite:
    """The worker's code, the command line and a second run agree."""

    @pytest.fixture
    def models(self, alice, bob, wakes):
        def upload(racer, car):
            files = [UploadPart(path.name, BytesIO(path.read_bytes())) for path in (car.onnx, car.metadata)]
            return upload_model(owner=racer, files=files, now=timezone.now()).model

        return [upload(alice, CAR), upload(bob, OTHER)]

    @pytest.fixture
    def run(self, models):
        def queue_and_run(rules, rivals=()):
            evaluation = queue_evaluation(
                owner=models[0].owner,
                model=models[0],
                rivals=rivals,
                track=track_row("oval"),
                rules=rules,
                now=timezone.now(),
            )
            assert run_next_evaluation(worker="w")
            evaluation.refresh_from_db()
            assert evaluation.state == "finished", evaluation.operator_detail
            return evaluation

        return queue_and_run

    @pytest.mark.parametrize(
        ("rules", "options"),
        [
            (
                RaceRules(race_type="object_avoidance", random_boxes=6, seed=5, laps=1),
                (*AVOID, "--obstacles", "6", "--seed", "5", "--laps", "1"),
            ),
            (
                RaceRules(race_type="head_to_head", bots=4, bot_lane_changes=True, seed=5, laps=1),
                (*DUEL, "--bots", "4", "--lane-changes", "--seed", "5", "--laps", "1"),
            ),
        ],
        ids=["boxes", "bots"],
    )
    def test_the_site_agrees_on_boxes_and_bots(self, run, rules, options):
        evaluation = run(rules)
        report = drive(*options)
        assert report["trace_sha256"] == evaluation.result.trace_sha256
        assert report["layout"]["boxes"] == evaluation.result.layout["boxes"]
        assert report["crashes"] == evaluation.result.crashes
        assert report["layout"]["bots"] == len(read_layout(evaluation.result)["bots"]) == rules.bots
        assert verify(evaluation)[0] == 0

    def test_the_site_agrees_on_a_duel_and_names_differences(self, run, models):
        evaluation = run(RaceRules(race_type="head_to_head", laps=1), rivals=models[1:])
        report = drive(*DUEL, "--laps", "1", "--rival", RIVAL)
        stored = evaluation.result.rivals.get()
        assert report["trace_sha256"] == evaluation.result.trace_sha256
        assert report["rivals"][0]["trace_sha256"] == stored.trace_sha256
        assert report["rivals"][0]["best_lap_ms"] == stored.best_lap_ms
        assert report["order"] == evaluation.result.order
        assert verify(evaluation)[0] == 0

        RivalResult.objects.update(trace_sha256="0" * 64, end_reason="retired", retired_code="policy_died")
        Result.objects.update(order=[*reversed(report["order"])], layout={"boxes": [BOX]})
        status, said = verify(evaluation)
        assert status == 1
        for part in (
            f"car 1: trace_sha256: was {'0' * 64}, is ",
            "car 1: reason for ending: was retired, is laps_done",
            "car 1: reason for retiring: was policy_died, is ",
            "order of the cars: was ",
            "boxes: was ",
        ):
            assert part in said, part
        assert "bot cars" not in said and "\ntrace_sha256" not in said
