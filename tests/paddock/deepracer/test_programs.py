"""Programs in the shapes that courses and their students publish run unchanged, with the two module names alone."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from scripts.package import build
from tests.shared import CHECKOUT

PROGRAMS = Path(__file__).parent / "programs"
NEEDS_TRAINING = ("own_dqn", "baselines", "parallel")
OLD = [sys.executable, "-m", "paddock.deepracer.old_gym"]


@pytest.fixture(scope="module")
def modules(tmp_path_factory) -> Path:
    """A folder with what the wheel of the two names installs."""
    folder = tmp_path_factory.mktemp("names")
    wheel = next(path for path in build(folder / "dist", "paddock_deepracer") if path.suffix == ".whl")
    zipfile.ZipFile(wheel).extractall(folder / "installed")
    return folder / "installed"


def run(command: list[str], modules: Path) -> str:
    path = os.pathsep.join((str(modules), str(CHECKOUT)))
    done = subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": path, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize(
    ("name", "last"),
    [
        ("newer", "done {} True []"),
        ("older", "done True"),
        pytest.param("own_dqn", "done True True []", marks=pytest.mark.slow),
        pytest.param("baselines", "done True True True []", marks=pytest.mark.slow),
        pytest.param("parallel", "done []", marks=pytest.mark.soak),  # such processes: test_many.py
    ],
)
def test_it_runs_unchanged(name, last, modules):
    if name in NEEDS_TRAINING:
        pytest.importorskip("stable_baselines3", reason="training is not installed: make training")
    said = run([sys.executable, str(PROGRAMS / f"{name}.py")], modules)
    expected = last.split("{}")
    assert said.startswith(expected[0]) and said.endswith(expected[-1])


def test_a_program_for_the_old_gym_runs_through_the_shim(modules):
    assert run([*OLD, str(PROGRAMS / "four_values.py")], modules) == "done True True []"


def test_the_wheel_has_the_two_names_alone_and_asks_for_the_racers_package(modules):
    tops = {path.name for path in modules.iterdir() if not path.name.endswith(".dist-info")}
    assert tops == {"deepracer", "deepracer_gym"}
    theirs, ours = (
        tomllib.loads((CHECKOUT / folder / "pyproject.toml").read_text())["project"]
        for folder in ("compat", "distribution")
    )
    assert theirs["version"] == ours["version"] and theirs["requires-python"] == ours["requires-python"]
    assert theirs["dependencies"] == [f"paddock-racing=={ours['version']}"]


def test_old_gym_says_how_it_is_called():
    done = subprocess.run(OLD, capture_output=True, text=True, cwd=CHECKOUT)
    assert done.returncode == 1 and "PROGRAM" in done.stderr
