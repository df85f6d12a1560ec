"""The files that racers download: deepracer-utils must read them as if the official simulator had written them."""

import csv
import io
import json

import numpy as np
import pytest

from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.results import metrics_json
from paddock.simulator.trace import COLUMNS
from tests.shared import SHARED, needs_shared

from .tracks_for_tests import stadium

TRACK = stadium()


@pytest.fixture(scope="module")
def result():
    pilot = CentreLinePilot(TRACK, speed=2.0)
    return run_race(RaceSettings(TRACK, RaceRules(laps=3), [Entrant(pilot.action_space, pilot.sensors, pilot)]))


@pytest.fixture(scope="module")
def troubled():
    """A run with faults, pauses and an unfinished lap, of a car with a discrete action list."""
    space = ActionSpace.discrete([(0.0, 1.0), (5.0, 2.0)])
    answers = lambda readings: np.float32([0.0, 1.0])  # noqa: E731
    return run_race(RaceSettings(TRACK, RaceRules(max_resets=2), [Entrant(space, (), answers)]))


def rows(result):
    return list(csv.DictReader(io.StringIO(result.trace.to_csv().decode())))


@needs_shared
def test_the_trace_has_the_official_columns_in_order():
    with open(SHARED / "traces" / "spain-2026-training-0.csv") as file:
        official = file.readline().strip().split(",")
    assert list(COLUMNS) == official


@needs_shared
def test_values_are_written_as_in_the_official_file(result, troubled):
    with open(SHARED / "traces" / "spain-2026-training-0.csv", newline="") as file:
        official = list(csv.DictReader(file))
    for row in (*rows(result), *rows(troubled)):
        assert row["done"] in {"True", "False"} and row["all_wheels_on_track"] in {"True", "False"}
        assert float(row["steps"]).is_integer() and "." in row["steps"]
        for column in ("episode", "action", "closest_waypoint", "obstacle_crash_counter"):
            int(row[column])
        assert -180 <= float(row["yaw"]) <= 180
    known = {row["episode_status"] for row in official} | {"lap_complete", "pause"}
    assert {row["episode_status"] for row in rows(troubled)} <= known


def test_a_row_holds_the_state_before_its_action(result):
    trace = result.trace
    assert trace["tstamp"][0] == 0.0 and trace["episode_status"][0] == "prepare"
    x, y, _ = TRACK.point_at(0.14)
    assert (trace["X"][0], trace["Y"][0]) == (pytest.approx(x), pytest.approx(y))
    assert len(trace) == result.steps + 1
    assert np.allclose(np.diff(trace["tstamp"]), 1 / 15)
    assert (trace["wall_clock"] == trace["tstamp"]).all()


def test_each_lap_is_an_episode_ending_with_lap_complete(result):
    trace = result.trace
    for lap in result.laps:
        mine = trace["episode"] == lap.number - 1
        assert trace["steps"][mine].tolist() == list(range(1, mine.sum() + 1))
        assert trace["episode_status"][mine][-1] == "lap_complete"
        assert trace["progress"][mine][-1] == 100.0 and trace["done"][mine][-1]
        assert not trace["done"][mine][:-1].any()


def test_discrete_actions_carry_their_index(troubled):
    driven = troubled.trace["episode_status"] == "in_progress"
    assert set(troubled.trace["action"][driven].tolist()) == {1}
    assert set(troubled.trace["steer"][driven].tolist()) == {5.0}


def test_the_hash_tells_traces_apart(result, troubled):
    assert len({result.trace.sha256, troubled.trace.sha256}) == 2
    assert len(result.trace.sha256) == 64


@needs_shared
def test_metrics_have_the_official_keys(troubled):
    official = json.loads((SHARED / "traces" / "a-to-z-2023-evaluation-metrics.json").read_text())
    ours = json.loads(json.dumps(metrics_json(troubled)))
    for lap in ours["metrics"]:
        assert set(official["metrics"][0]) <= set(lap)
        assert lap["metric_time"] - lap["start_time"] == lap["elapsed_time_in_milliseconds"]
    assert ours["metrics"][0]["off_track_count"] == 3 and ours["metrics"][0]["reset_count"] == 2
    assert ours["metrics"][0]["episode_status"] == "Off track"


def test_deepracer_utils_reads_the_trace(result, troubled, tmp_path):
    log = pytest.importorskip("deepracer.logs")
    for stamp, run in (("20260101000000", result), ("20260102000000", troubled)):
        folder = tmp_path / "sim-trace" / "evaluation" / f"{stamp}-paddock" / "evaluation-simtrace"
        folder.mkdir(parents=True)
        (folder / "0-iteration.csv").write_bytes(run.trace.to_csv())
    reader = log.DeepRacerLog(model_folder=str(tmp_path), verbose=False)
    reader.load_evaluation_trace(ignore_metadata=True)
    frame = reader.dataframe()
    assert len(frame) == len(result.trace) + len(troubled.trace)
    laps = log.AnalysisUtils.simulation_agg(frame, firstgroup="stream", is_eval=True)
    clean = laps[laps["stream"] == "20260101000000-paddock"]
    assert clean["progress"].tolist() == [100.0, 100.0, 100.0]
    # The tool measures from row to row, so it is up to a step off at each end.
    assert clean["time"].tolist() == pytest.approx([lap.time_ms / 1000 for lap in result.laps], abs=0.14)
    assert clean["off_track"].sum() == 0
    assert laps[laps["stream"] == "20260102000000-paddock"]["off_track"].sum() == 3


def test_deepracer_utils_reads_the_metrics(result, tmp_path, monkeypatch):
    log = pytest.importorskip("deepracer.logs.metrics")
    for name, value in (("AWS_ACCESS_KEY_ID", "none"), ("AWS_SECRET_ACCESS_KEY", "none")):
        monkeypatch.setenv(name, value)  # it makes an S3 client even to read a file
    path = tmp_path / "metrics.json"
    path.write_text(json.dumps(metrics_json(result)))
    frame = log.TrainingMetrics(None, region="us-east-1", fname=str(path)).getEvaluation()
    assert frame["time"].tolist() == [lap.time_ms / 1000 for lap in result.laps]
    assert frame["complete"].tolist() == [1, 1, 1]
