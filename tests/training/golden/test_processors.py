"""One car, one result, on every x86-64 processor: the golden runs as processors that lack what this one has."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from dataclasses import replace

import pytest

from paddock.rules.race import RaceRules
from tests.shared import CHECKOUT
from training.golden.cars import car
from training.golden.processors import EMULATOR, NATIVE, PROCESSORS, Processor, ProcessorFailed, emulator, side_by_side
from training.golden.runs import CONSOLE, RUNS, GoldenRun, runs_of

pytestmark = [
    pytest.mark.skipif(platform.machine() != "x86_64", reason="this is no x86-64 machine"),
    pytest.mark.skipif(emulator() is None, reason=f"{EMULATOR} is not installed (Debian: qemu-user)"),
]
# Of each run, which an emulated processor takes about as long for, a large network twenty times as long
SIMULATED_MS, CONSOLE_MS = 600, 200
CONSOLES = next(run.name for run in RUNS if CONSOLE in run.cars)
SOAKED = 200
OLDEST = PROCESSORS[0]  # the least like this one; all the others in `make soak`


@pytest.fixture(scope="module")
def admitted(paths, tmp_path_factory) -> dict[str, str]:
    """Every car by a path, admitted on this machine and driven on others, as a league's cars are. `make soak` admits
    them on each."""
    folder = tmp_path_factory.mktemp("admitted")
    found = dict(paths)
    for name in {name for run in RUNS for name in run.cars} - {CONSOLE}:
        one, path = car(name), folder / name
        path.with_suffix(".onnx").write_bytes(one.onnx)
        path.with_suffix(".json").write_text(json.dumps({**one.metadata, "facts": one.facts}))
        found[name] = str(path)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "processor", [OLDEST, *(pytest.param(name, marks=pytest.mark.soak) for name in PROCESSORS if name != OLDEST)]
)
def test_golden_runs_are_the_same_on_another_processor(processor, admitted):
    check([processor], [begun(run) for run in runs_of((), admitted)])


def begun(run: GoldenRun) -> GoldenRun:
    """The beginning of a run."""
    return run.shortened(CONSOLE_MS if run.name == CONSOLES else SIMULATED_MS)


@pytest.mark.soak
@pytest.mark.parametrize("processor", PROCESSORS)
def test_two_hundred_runs_are_the_same_on_every_processor(processor, paths):
    """Every processor drives a fourth of them: whole golden runs, and their cars elsewhere, among other boxes and
    bots."""
    whole = runs_of((), paths)
    moved = [elsewhere(run, number) for number in (1, 2, 3) for run in whole if run.name != CONSOLES]
    check([processor], [*whole, *moved][: SOAKED // len(PROCESSORS)])


def elsewhere(run: GoldenRun, number: int) -> GoldenRun:
    """The run on another track, in the other direction, with another seed, for five seconds."""
    tracks = sorted({each.track for each in RUNS})
    track = tracks[(tracks.index(run.track) + number) % len(tracks)]
    direction = "cw" if run.rules.direction == "ccw" else "ccw"
    changed = {"direction": direction, "seed": run.rules.seed + number, "max_simulated_ms": 5000}
    if run.rules.boxes:
        changed |= {"boxes": (), "random_boxes": 5}
    return replace(run, name=f"{run.name} {number}", track=track, rules=RaceRules(**{**vars(run.rules), **changed}))


def check(processors: list[str], runs: list[GoldenRun]) -> None:
    with side_by_side([NATIVE, *processors], runs) as processes:
        native, *others = [process.driven() for process in processes]
    for processor, driven in zip(processors, others, strict=True):
        differ = [there.name for here, there in zip(native, driven, strict=True) if here != there]
        assert not differ, f"{processor} comes to other results than this machine: {'; '.join(differ)}"
    assert [one.name for one in native] == [run.name for run in runs]


def test_a_missing_instruction_is_reported():
    with side_by_side(["core2duo"], [RUNS[0]]) as (process,), pytest.raises(ProcessorFailed) as caught:
        process.driven()
    assert "core2duo: it lacks an instruction that Paddock needs (SIGILL)" in str(caught.value)


def test_an_unknown_processor_is_named():
    with side_by_side(["abacus"], [RUNS[0]]) as (process,), pytest.raises(ProcessorFailed) as caught:
        process.driven()
    assert "abacus" in str(caught.value)


def test_a_run_that_takes_too_long_is_ended():
    process = Processor(PROCESSORS[0], [RUNS[0]], limit_s=0.1)
    with pytest.raises(ProcessorFailed, match="not done after 0 s"):
        process.driven()
    process.close()
    assert process._process.poll() is not None


def test_a_missing_emulator_says_what_to_install(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(ProcessorFailed, match="Debian: qemu-user"), side_by_side([PROCESSORS[0]], []):
        pass


def test_a_bare_process_without_the_pins_refuses_to_drive():
    environment = {name: value for name, value in os.environ.items() if name not in ("GLIBC_TUNABLES",)}
    done = subprocess.run(
        [sys.executable, "-m", "training.golden.bare_process"],
        input="[]",
        env=environment,
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert "python -m paddock.exact" in done.stderr
