"""The benchmarks run at their smallest, and say what they promise to say."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest

from benchmarks import evaluation
from benchmarks.models import cars
from benchmarks.processor import Clock
from league.models import Season
from tests import database
from tests.benchmarks.running import run

SMALLEST = ("--track", "oval", "--laps", "1", "--runs", "1", "--steps", "5", "--models", "steady")


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory, new_data: Callable[[Path], Path]) -> dict:
    """What one run finds, with a running site: one whose operator has a season of their own, in which no house car
    races before anything can be measured."""
    site = new_data(tmp_path_factory.mktemp("site") / "data")
    if (site / "paddock.sqlite3").exists():
        mine = Season(slug="mine", name="Mine", starts_on=date(2020, 1, 1), ends_on=date(2020, 12, 31))
        database.insert(site / "paddock.sqlite3", mine)
    return json.loads(run("benchmarks.evaluation", "--json", *SMALLEST, BENCH_SITE=site))


@pytest.mark.soak
def test_evaluations_are_measured_and_their_time_explained(measured) -> None:
    assert measured["real_time_factor"]["steady"] > 1
    assert measured["cpu_factor"]["steady"] > 1
    shares = measured["shares"]["steady"]
    assert set(shares) == {"physics", "network", "camera", "pipes", "start", "other"}
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.01)
    assert measured["bullet_and_network"]["steady"] == pytest.approx(shares["physics"] + shares["network"])
    assert 50 < measured["peak_mb"] < 2000
    assert measured["startup_s"]["steady"] > 0
    assert measured["tiny_renderer"]["ratio"] > 1
    for kind in ("warped", "six_boxes", "six_in_view"):
        assert 0 < measured["tiny_renderer"][kind]["frame_ms"] < measured["tiny_renderer"]["tiny_renderer"]["frame_ms"]
    crowd = measured["traffic"]
    assert crowd["model"] == "steady" and crowd["time_trial"]["ratio"] == 1.0
    for kind in ("object_avoidance", "head_to_head"):
        assert crowd[kind]["real_time_factor"] > 1
        assert crowd[kind]["ratio"] == pytest.approx(crowd[kind]["cpu_factor"] / crowd["time_trial"]["cpu_factor"])
    assert measured["machine"]["engine"]
    assert "steady" in evaluation.table(measured)


@pytest.mark.soak
def test_a_car_is_timed_from_upload_to_rank(measured) -> None:
    timed = measured["upload_to_ranked"]
    assert measured["upload_to_ranked_s"] == timed["total_s"] > 0
    assert sum(timed[part] for part in ("upload_s", "enter_s", "submit_s", "queue_s", "evaluate_s", "rank_s")) == (
        pytest.approx(timed["total_s"])
    )
    assert set(timed["models"]) == {"steady"}


@pytest.mark.parametrize(("options", "with_site"), [((), True), (("--no-site",), False)])
def test_the_running_site_can_be_left_out(options, with_site, monkeypatch, capsys) -> None:
    asked = {}
    monkeypatch.setattr(evaluation, "run", lambda **how: asked.update(how) or figures(upload_to_ranked_s=None))

    assert evaluation.main(["--json", *options]) == 0

    assert asked["with_site"] is with_site
    assert json.loads(capsys.readouterr().out)["upload_to_ranked_s"] is None


def figures(**changes: object) -> dict:
    """Figures that keep every promise."""
    return {
        "real_time_factor": {"console": 60.0, "steady": 160.0},
        "bullet_and_network": {"console": 0.8, "steady": 0.6},
        "upload_to_ranked_s": 4.0,
        "peak_mb": 400.0,
        "traffic": {"object_avoidance": {"ratio": 0.8}, "head_to_head": {"ratio": 0.7}},
        "tiny_renderer": {"six_boxes": {"frame_ms": 0.12}},
    } | changes


def test_figures_that_keep_every_promise_have_no_miss() -> None:
    assert evaluation.misses(figures()) == []
    assert evaluation.misses(figures(upload_to_ranked_s=None)) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"real_time_factor": {"console": 49.0}}, "console runs 49.0 times"),
        ({"real_time_factor": {"steady": 149.0}}, "steady runs 149.0 times"),
        ({"traffic": {"object_avoidance": {"ratio": 0.6}, "head_to_head": {"ratio": 0.7}}}, "avoidance runs at 60%"),
        ({"traffic": {"object_avoidance": {"ratio": 0.8}, "head_to_head": {"ratio": 0.6}}}, "head_to_head runs at 60%"),
        ({"tiny_renderer": {"six_boxes": {"frame_ms": 0.151}}}, "a frame with six boxes takes 0.151 ms"),
        ({"bullet_and_network": {"steady": 0.4}}, "steady spends 40%"),
        ({"upload_to_ranked_s": 11.0}, "11.0 s from upload to rank"),
        ({"peak_mb": 601.0}, "601 MB"),
    ],
)
def test_a_broken_promise_is_named(change: dict, said: str) -> None:
    (found,) = evaluation.misses(figures(**change))

    assert said in found


def test_house_cars_are_measured_with_their_metadata() -> None:
    steady = next(car for car in cars() if car.name == "steady")

    assert [name for name, _ in steady.files] == ["steady.onnx", "model_metadata.json"]


def test_the_clock_counts_cpu_time_of_children() -> None:
    clock = Clock()
    with subprocess.Popen(
        [sys.executable, "-c", "while True: pass"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    ) as child:
        clock.look()
        first = clock.seconds
        while clock.seconds < first + 0.1:
            clock.look()
        child.kill()
    clock.close()

    assert clock.seconds >= first + 0.1
