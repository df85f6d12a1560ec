"""No result moves unseen: every golden run comes to what the engine's table says, in the sandbox and without it."""

from __future__ import annotations

import json

import pytest

from paddock.packages.inputs import CAMERAS, LIDARS
from paddock.rules.race import DIRECTIONS, RACE_TYPES
from paddock.simulator.engine import ENGINE_ID
from tests.sandbox.conftest import nothing_left  # noqa: F401
from tests.soak import only
from training.golden import __main__ as command
from training.golden import table
from training.golden.cars import car
from training.golden.drive import Driven, in_this_process, through_the_pipeline
from training.golden.processors import NATIVE, side_by_side
from training.golden.runs import CONSOLE, PROOF, RUNS, runs_of

pytestmark = pytest.mark.slow

NAMES = [run.name for run in RUNS]
# In the sandbox, one of each race type and the console's car; all of them without it, in one process
IN_THE_SANDBOX = (*PROOF, "a lap by continuous actions", "a car of the old console")


@pytest.fixture(scope="module")
def rows() -> dict:
    assert table.path_of().is_file(), f"{ENGINE_ID} has no table: write it with `python -m training.golden --write`"
    return table.rows_of()


def moved(said: list[str | None]) -> str:
    """What a failing test tells: what moved, and what to do."""
    return "\n".join([*filter(None, said), table.ADVICE])


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("name", only(IN_THE_SANDBOX, NAMES), ids=lambda name: name.replace(" ", "_").replace(",", ""))
def test_golden_runs_match_the_table_of_this_engine(name, rows, paths):
    runs = runs_of([name], paths)
    if not runs:
        pytest.skip("the console's car is not beside this checkout")
    difference = table.difference(rows.get(name), runs[0], through_the_pipeline(runs[0]))
    assert difference is None, moved([difference])


def test_one_process_without_a_sandbox_gives_the_same_runs(rows, paths):
    runs = runs_of((), paths)
    with side_by_side([NATIVE], runs) as (process,):
        driven = process.driven()
    said = [table.difference(rows.get(run.name), run, came) for run, came in zip(runs, driven, strict=True)]
    assert not any(said), moved(said)


def test_golden_runs_cover_every_race_sensor_and_action_space(paths):
    assert {run.rules.race_type for run in RUNS} == set(RACE_TYPES)
    assert {run.rules.direction for run in RUNS} == set(DIRECTIONS)
    assert len({run.track for run in RUNS}) >= 6
    assert {bool(run.rules.boxes) for run in RUNS if run.rules.race_type == "object_avoidance"} == {True, False}
    assert {bool(run.rules.bots) for run in RUNS if run.rules.race_type == "head_to_head"} == {True, False}
    cars = [car(name).metadata for run in RUNS for name in run.cars if name != CONSOLE]
    assert {sensor for one in cars for sensor in one["sensor"]} == {*CAMERAS, *LIDARS}
    assert {one["action_space_type"] for one in cars} == {"discrete", "continuous"}
    assert max(len(run.cars) for run in RUNS) == 2


def test_the_table_lists_exactly_the_golden_runs(rows):
    assert list(rows) == NAMES
    assert len(set(NAMES)) == len(NAMES) and set(PROOF) < set(NAMES)


def test_golden_runs_include_crashes_and_resets(rows):
    """Off the road, over the line, into boxes and bots: what never happens in any run could move unseen."""
    ends = {one["end_reason"] for row in rows.values() for one in row["cars"]}
    assert ends == {"laps_done", "time_up", "resets_used"}
    statuses = set()
    for name in (
        "a lap by continuous actions",
        "boxes in drawn places, met with a lidar",
        "commands that nobody trained",
    ):
        (run,) = runs_of([name])
        statuses |= statuses_of(run)
    assert {"off_track", "crashed", "pause", "lap_complete"} <= statuses


def statuses_of(run) -> set[str]:
    from evaluation.running.pipeline import RaceJob, evaluate

    one = car(run.cars[0])
    trace = evaluate(RaceJob(run.geometry(), run.rules, one.onnx, one.metadata)).trace_csv.decode()
    header, *lines = trace.splitlines()
    at = header.split(",").index("episode_status")
    return {line.split(",")[at] for line in lines}


# --- the table -----------------------------------------------------------------------------------------------------


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    """An engine without a table."""
    monkeypatch.setattr(table, "TABLES", tmp_path)
    return tmp_path


@pytest.fixture
def driven() -> Driven:
    return through_the_pipeline(SHORT)


(LONG,) = runs_of(["two eyes"])
SHORT = LONG.shortened(400)


def test_an_existing_table_is_never_overwritten(elsewhere, driven):
    path = table.write([SHORT], [driven])
    before = path.read_text()
    assert json.loads(before)["engine"] == ENGINE_ID == path.stem
    with pytest.raises(FileExistsError):
        table.write([SHORT], [driven])
    assert path.read_text() == before
    assert table.difference(table.rows_of()["two eyes"], SHORT, driven) is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"trace_sha256": "0" * 64}, "two eyes: trace_sha256 of car 0 is "),
        ({"model": "0" * 64}, "two eyes: model of car 0 is "),
        ({"lap_ms": [1]}, "two eyes: lap_ms of car 0 is [] and was [1]"),
        ({"end_reason": "laps_done"}, "two eyes: end_reason of car 0 is time_up and was laps_done"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else None,
)
def test_the_difference_names_what_moved(elsewhere, driven, change, said):
    table.write([SHORT], [driven])
    row = table.rows_of()["two eyes"]
    row["cars"][0].update(change)
    assert table.difference(row, SHORT, driven).startswith(said)


def test_a_different_run_of_the_same_name_is_not_equal(elsewhere, driven):
    table.write([SHORT], [driven])
    row = table.rows_of()["two eyes"]
    assert "its rules is" in table.difference(row, LONG, driven)
    assert "no such run" in table.difference(None, SHORT, driven)
    row["cars"] *= 2
    assert "1 cars drove where the table has 2" in table.difference(row, SHORT, driven)


# --- the command ---------------------------------------------------------------------------------------------------


def test_the_command_lists_equal_and_moved_runs(elsewhere, capsys):
    assert command.main(["two eyes"]) == 1
    assert "has no table" in capsys.readouterr().err
    table.write([LONG], [through_the_pipeline(LONG)])
    assert command.main(["two eyes"]) == 0
    assert f"{ENGINE_ID}: 1 of 1 equal" in capsys.readouterr().out
    path = table.path_of()
    path.write_text(path.read_text().replace('"trace_sha256": "', '"trace_sha256": "x'))
    assert command.main(["two eyes"]) == 1
    told = capsys.readouterr()
    assert "two eyes: trace_sha256 of car 0 is" in told.out and "0 of 1 equal" in told.out
    assert "raise ENGINE_ID in paddock/simulator/engine.py" in told.err


def test_the_command_does_not_overwrite_a_table(monkeypatch, capsys):
    monkeypatch.setattr(command, "runs_of", lambda *_: [SHORT])
    before = table.path_of().read_text()
    assert command.main(["--write"]) == 1
    assert "has its table already" in capsys.readouterr().err
    assert table.path_of().read_text() == before


def test_the_command_writes_nothing_when_the_two_ways_differ(elsewhere, monkeypatch, capsys):
    monkeypatch.setattr(command, "runs_of", lambda *_: [SHORT])
    monkeypatch.setattr(command, "_bare", lambda runs: [in_this_process(LONG)])
    assert command.main(["--write"]) == 1
    assert "differ" in capsys.readouterr().err and not list(elsewhere.iterdir())


def test_the_command_prints_the_results_of_a_bare_process(capfd):
    assert command.main(["--bare", "two eyes"]) == 0
    (answer,) = json.loads(capfd.readouterr().out)
    assert Driven.from_dict(answer).traces == through_the_pipeline(LONG).traces


def test_the_command_refuses_an_unknown_run(capsys):
    with pytest.raises(SystemExit):
        command.main(["no such run"])
    assert "there is no run 'no such run'" in capsys.readouterr().err
