"""``python -m training.golden``: drive the golden runs and compare them with the present engine's table."""

import argparse
import contextlib
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from evaluation.garage.admission import admit
from paddock.errors import PaddockError
from paddock.packages.read import UploadPart
from paddock.simulator.engine import ENGINE_ID

from . import table
from .drive import Driven, through_the_pipeline
from .processors import NATIVE, PROCESSORS, ProcessorFailed, side_by_side
from .runs import CONSOLE, RUNS, GoldenRun, runs_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status 0: every run equals the table, or the table was written; 1: a run differs; 2: wrong arguments."""
    parser = argparse.ArgumentParser("python -m training.golden", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="RUN", help="only these runs, by name")
    parser.add_argument(
        "--console", metavar="ARCHIVE", help="model.tar.gz of the old console's car, which drives a run"
    )
    parser.add_argument("--bare", action="store_true", help="in one process without the sandbox; prints JSON")
    parser.add_argument("--write", action="store_true", help="write the table of an engine that has none")
    parser.add_argument(
        "--processors", nargs="*", metavar="NAME", help=f"compare with these, emulated: {', '.join(PROCESSORS)}"
    )
    options = parser.parse_args(arguments)
    if options.write and (options.names or options.bare or options.processors is not None):
        parser.error("a table is written of all runs, in the sandbox")
    with contextlib.ExitStack() as stack:
        paths = {CONSOLE: stack.enter_context(console_car(Path(options.console)))} if options.console else {}
        try:
            runs = runs_of(options.names, paths)
        except KeyError as error:
            parser.error(f"there is no run {error.args[0]!r}; there are: {'; '.join(run.name for run in RUNS)}")
        try:
            if options.processors is not None:
                return _on_processors(options.processors or list(PROCESSORS), runs)
            if options.bare:
                print(json.dumps([asdict(driven) for driven in _bare(runs)], indent=1))
                return 0
            driven = [through_the_pipeline(run) for run in runs]
            return _write(runs, driven) if options.write else _compare(runs, driven)
        except (PaddockError, ProcessorFailed) as error:
            print(error, file=sys.stderr)
            return 1


@contextlib.contextmanager
def console_car(archive: Path) -> Iterator[str]:
    """The path of a car (see :func:`.cars.car`) that is in an archive, for as long as the context lasts. Raises
    PaddockError, OSError."""
    with archive.open("rb") as file:
        package = admit([UploadPart(archive.name, file)])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / CONSOLE
        path.with_suffix(".onnx").write_bytes(package.onnx)
        described = {**package.metadata.to_dict(), "facts": package.facts.to_dict()}
        path.with_suffix(".json").write_text(json.dumps(described))
        yield str(path)


def _bare(runs: Sequence[GoldenRun]) -> list[Driven]:
    with side_by_side([NATIVE], runs) as (process,):
        return process.driven()


def _compare(runs: Sequence[GoldenRun], driven: Sequence[Driven]) -> int:
    try:
        rows = table.rows_of()
    except FileNotFoundError:
        print(f"{ENGINE_ID} has no table: write it with --write", file=sys.stderr)
        return 1
    differences = [table.difference(rows.get(run.name), run, came) for run, came in zip(runs, driven, strict=True)]
    for run, difference in zip(runs, differences, strict=True):
        print(difference or f"{run.name}: equal")
    differ = sum(difference is not None for difference in differences)
    print(f"{ENGINE_ID}: {len(runs) - differ} of {len(runs)} equal")
    if differ:
        print(table.ADVICE, file=sys.stderr)
    return 1 if differ else 0


def _write(runs: Sequence[GoldenRun], driven: Sequence[Driven]) -> int:
    """Write the table if the sandbox and a bare process computed the same; otherwise refuse."""
    if [one.traces for one in _bare(runs)] != [one.traces for one in driven]:
        print("in the sandbox and in a bare process the runs differ: nothing is written", file=sys.stderr)
        return 1
    try:
        path = table.write(runs, driven)
    except FileExistsError:
        print(f"{ENGINE_ID} has its table already, which stays as it is. {table.ADVICE}", file=sys.stderr)
        return 1
    print(f"{path}: {len(runs)} runs")
    for left_out in {run.name for run in RUNS} - {run.name for run in runs}:
        print(f"without “{left_out}”: give its car with --console", file=sys.stderr)
    return 0


def _on_processors(names: Sequence[str], runs: Sequence[GoldenRun]) -> int:
    with side_by_side([NATIVE, *names], runs) as processes:
        native, *others = [process.driven() for process in processes]
    equal = 0
    for name, driven in zip(names, others, strict=True):
        for here, there in zip(native, driven, strict=True):
            equal += here.traces == there.traces
            if here.traces != there.traces:
                print(f"{name}: {here.name}: {', '.join(there.traces)} where it is {', '.join(here.traces)} here")
    wanted = len(names) * len(runs)
    print(f"{equal} of {wanted} equal to this machine's")
    return 0 if equal == wanted else 1


if __name__ == "__main__":
    sys.exit(main())
