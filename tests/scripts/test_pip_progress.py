"""The line that ``make`` prints while pip works."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "pip_progress.py"


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    lock = tmp_path / "run.txt"
    lock.write_text("# made\none==1.0 \\\n    --hash=sha256:00\ntwo==2.0 \\\n    --hash=sha256:00\n")
    return lock


def install(tmp_path: Path, lock: Path, pip: str) -> subprocess.CompletedProcess:
    """Run the script with a module of this text in the place of pip."""
    (tmp_path / "pip.py").write_text(pip)
    command = [sys.executable, SCRIPT, "install", "--requirement", lock]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)


def test_one_line_has_the_count_and_the_time(tmp_path, lock):
    done = install(
        tmp_path,
        lock,
        "import sys\nprint('Collecting one==1.0')\nprint('WARNING: an index', file=sys.stderr)\n"
        "print('Requirement already satisfied: two==2.0')\nprint('Installing collected packages: one')\n",
    )
    assert done.returncode == 0
    assert done.stderr == ""
    (line,) = done.stdout.splitlines()
    assert line.startswith(f"Installing {lock} (2 packages) ... unpacking ... ")
    assert line.endswith(" s")


@pytest.mark.parametrize(
    ("package", "name"), [("a/b/one-1.0-py3-none-any.whl", "one-1.0-py3-none-any.whl"), (".", "Paddock")]
)
def test_a_package_is_named_without_its_folder(tmp_path, package, name):
    (tmp_path / "pip.py").write_text("")
    command = [sys.executable, SCRIPT, "install", package]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith(f"Installing {name} ...")


def test_what_pip_printed_is_shown_when_it_fails(tmp_path, lock):
    done = install(
        tmp_path, lock, "import sys\nprint('Collecting one==1.0', flush=True)\nsys.exit('ERROR: hashes differ')\n"
    )
    assert done.returncode == 1
    assert done.stdout.splitlines()[1:] == ["Collecting one==1.0", "ERROR: hashes differ"]


def test_the_last_line_names_an_index_that_cannot_be_reached(tmp_path, lock):
    refused = "NewConnectionError('<HTTPSConnection>: Failed to establish a new connection: [Errno -3]')"
    done = install(tmp_path, lock, f"import sys\nprint({refused!r})\nsys.exit('ERROR: No matching distribution')\n")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("The package index cannot be reached: connect to a network")


def test_a_large_file_is_named_and_the_megabytes_are_counted(tmp_path, lock, monkeypatch):
    monkeypatch.setenv("STEP", "4")
    monkeypatch.setenv("STEPS", "5")
    done = install(
        tmp_path,
        lock,
        "print('  Downloading one-1.0-py3-none-any.whl (850.5 kB)')\n"
        "print('Downloading https://index/files/torch-2.13.0-cp313-linux_x86_64.whl.metadata (28 kB)')\n"
        "print('  Downloading torch-2.13.0%2Bcpu-cp313-cp313-linux_x86_64.whl (760.2 MB)')\n",
    )
    (line,) = done.stdout.splitlines()
    assert line.startswith(f"[4/5] Installing {lock} (2 packages) ... downloading 760 MB of torch ... 761 MB, ")
