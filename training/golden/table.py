"""The table of an engine: the result of each golden run, and the comparison with it."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID, versions

from .drive import Driven
from .runs import GoldenRun

TABLES = Path(__file__).resolve().parent / "tables"
ADVICE = (
    "A result moved: raise ENGINE_ID in paddock/simulator/engine.py, and write the new engine's table with "
    "`python -m training.golden --write`. A result that was not meant to move is a fault to find."
)

Row = dict[str, Any]


def path_of(engine: str = ENGINE_ID) -> Path:
    return TABLES / f"{engine}.json"


def rows_of(engine: str = ENGINE_ID) -> dict[str, Row]:
    """The rows of an engine's table by the names of their runs. Raises FileNotFoundError where it has none."""
    return {row["name"]: row for row in json.loads(path_of(engine).read_text())["runs"]}


def write(runs: Sequence[GoldenRun], driven: Sequence[Driven]) -> Path:
    """Write the table of the present engine. Raises FileExistsError if there is one: a table never changes."""
    table = {
        "engine": ENGINE_ID,
        "versions": versions(),
        "runs": [_row(*each) for each in zip(runs, driven, strict=True)],
    }
    path = path_of()
    with path.open("x") as file:
        file.write(json.dumps(table, indent=1) + "\n")
    return path


def difference(row: Row | None, run: GoldenRun, driven: Driven) -> str | None:
    """The first difference between a run and its row in the table, as a sentence; None if they are equal."""
    if row is None:
        return f"{run.name}: the table of {ENGINE_ID} has no such run"
    found = _row(run, driven)
    # a rule that is newer than the table had its default then
    was_run = {**row, "rules": json.loads(json.dumps(RaceRules.from_dict(row["rules"]).to_dict()))}
    for what in ("track", "fingerprint", "rules"):
        if was_run[what] != found[what]:
            return f"{run.name}: not the run of the table, its {what} is {found[what]} and was {row[what]}"
    if len(row["cars"]) != len(found["cars"]):
        return f"{run.name}: {len(found['cars'])} cars drove where the table has {len(row['cars'])}"
    for number, (was, came) in enumerate(zip(row["cars"], found["cars"], strict=True)):
        for what in ("model", "end_reason", "lap_ms", "trace_sha256"):
            if was[what] != came[what]:
                return f"{run.name}: {what} of car {number} is {came[what]} and was {was[what]}"
    return None


def _row(run: GoldenRun, driven: Driven) -> Row:
    rules = json.loads(json.dumps(run.rules.to_dict()))  # as they come back from a file
    cars = [
        {
            "car": Path(name).name,
            "model": came.model,
            "lap_ms": came.lap_ms,
            "end_reason": came.end_reason,
            "trace_sha256": came.trace_sha256,
        }
        for name, came in zip(run.cars, driven.cars, strict=True)
    ]
    return {"name": run.name, "track": run.track, "fingerprint": driven.track, "rules": rules, "cars": cars}
