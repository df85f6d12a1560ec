"""The code of the page of common changes works: a sensor here, the others in the tests of new methods and formats."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.shared import CHECKOUT

from .pages import code_blocks, section, text

PAGE = text("changes.md")
SENSOR = section(PAGE, "## A sensor")
SITE = """
import django
django.setup()
from races.models.sensors import OFFERABLE
from training.vehicles.forms import VehicleForm
from paddock.packages.inputs import SENSORS
assert "WIDE_CAMERA" in OFFERABLE
assert ("WIDE_CAMERA", "wide camera") in VehicleForm.base_fields["camera"].choices
"""


def apply(diff: str, folder: Path) -> None:
    """Change the files of a folder as the page says. Lines without a mark are those that a change follows."""
    for name, changes in re.findall(r"^\+\+\+ (.+)\n((?:[ +-](?!--|\+\+).*\n?)+)", diff, flags=re.M):
        source = (folder / name).read_text()
        for hunk in re.findall(r"((?:^[ -].*\n)+)((?:^\+.*\n)+)", changes, flags=re.M):
            before = "".join(line[1:] for line in hunk[0].splitlines(keepends=True))
            kept = "".join(line[1:] for line in hunk[0].splitlines(keepends=True) if line[0] == " ")
            after = "".join(line[1:] for line in hunk[1].splitlines(keepends=True))
            assert source.count(before) == 1, (name, before)
            source = source.replace(before, kept + after)
        (folder / name).write_text(source)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The checkout with an engine of its own to change; the rest is linked."""
    for path in CHECKOUT.iterdir():
        if path.is_dir() and path.name != "paddock" and not path.name.startswith("."):
            (tmp_path / path.name).symlink_to(path)
    shutil.copytree(CHECKOUT / "paddock", tmp_path / "paddock")
    return tmp_path


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(folder), "DJANGO_SETTINGS_MODULE": "tests.settings"}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


def test_the_steps_of_a_sensor_add_it_to_simulator_races_and_vehicles(copy: Path) -> None:
    (diff,) = code_blocks(SENSOR, "diff")
    (example,) = code_blocks(textwrap.dedent(SENSOR.split("3. Try it:", 1)[1].split("\n4. ", 1)[0]), "python")
    assert "WIDE_CAMERA" in run(example, copy).stderr, "the sensor does not exist yet"
    apply(diff, copy)
    for code in (example, SITE):
        assert run(code, copy).returncode == 0, run(code, copy).stderr


def test_every_named_file_and_folder_exists() -> None:
    named = re.findall(r"`((?:paddock|races|tests|training|evaluation|league|accounts|docs)/[\w/.]+)`", PAGE)
    assert len(named) > 10 and [name for name in named if not (CHECKOUT / name).exists()] == []
    modules = re.findall(r"-m (tests\.docs\.\w+)", PAGE)
    assert modules and all((CHECKOUT / f"{name.replace('.', '/')}.py").exists() for name in modules)
