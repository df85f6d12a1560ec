"""A command that drives starts anew with the site's arithmetic, and a copy of it drives: the same as a new process."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from paddock.cli import pinned
from paddock.exact import is_pinned
from tests.shared import CHECKOUT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there a new process drives")
CAR = [str(CHECKOUT / "training" / "house_cars" / f"flyer.{end}") for end in ("onnx", "json")]
RUN = ["evaluate", *CAR, "--track", "oval", "--rule", "max_simulated_ms=10000", "--json"]
DYING = """
import sys
from paddock.cli import driving
from paddock.cli.showing import Speaker
from paddock.errors import PlatformFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules

def drive(job, folder):
    {}

driving.drive_at_home = drive
try:
    with driving.driven(driving.Where(by_slug("oval"), "official", RaceRules()), Speaker(True), cars=[]):
        pass
except PlatformFault as fault:
    print(driving.is_ready(), fault.code, fault.params["problem"])
"""


def command(*arguments):
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, cwd=CHECKOUT)
    return done.returncode, done.stdout, done.stderr


def test_a_copy_drives_as_a_new_process_does(paddock):
    status, out, _ = command("-m", "paddock.cli", *RUN)
    other = paddock(*RUN)
    assert (status, json.loads(out)) == (other.status, other.json)
    assert status == 0 and not pinned.is_ready()


def test_a_refusal_is_the_same(paddock, tmp_path):
    (tmp_path / "car.onnx").write_bytes(b"nothing")
    broken = ["evaluate", str(tmp_path / "car.onnx"), CAR[1], "--track", "oval"]
    status, out, said = command("-m", "paddock.cli", *broken)
    other = paddock(*broken)
    assert status == other.status == 2 and out == other.out == ""
    assert said.strip().split("\n")[-1] == other.err.strip().split("\n")[-1]


@pytest.mark.parametrize(
    ("end", "problem"),
    [
        ("raise OSError('no room')", "OSError: no room"),
        ("return 3", "exit status 3"),
        ("import os; os.kill(os.getpid(), 9)", "exit status -9"),
    ],
)
def test_a_copy_that_dies_is_said(end, problem):
    environment = pinned.environment()
    assert is_pinned(environment)
    done = subprocess.run(
        [*pinned.PYTHON, "-c", DYING.format(end)], capture_output=True, text=True, cwd=CHECKOUT, env=environment
    )
    assert done.stdout == f"True drive_failed {problem}\n", done.stderr


def test_only_commands_that_drive_start_anew(monkeypatch):
    started = []
    monkeypatch.setattr("os.execve", lambda *arguments: started.append(arguments))
    for arguments in (["races"], [], ["evaluate", "--help"], ["verify", "abc"]):
        monkeypatch.setattr(sys, "argv", ["paddock", *arguments])
        pinned.get_ready()
    assert [said[3:] for _, said, _ in started] == [
        ["paddock.cli", "evaluate", "--help"],
        ["paddock.cli", "verify", "abc"],
    ]
