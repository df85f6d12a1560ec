"""A command that drives starts anew with the site's arithmetic, and a copy of it drives: the same as a new process."""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import sys

import pytest

from paddock.cli import pinned
from paddock.exact import is_pinned
from paddock.rules.race import RaceRules
from paddock.simulator import compiled
from tests.shared import CHECKOUT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there a new process drives")
CAR = [str(CHECKOUT / "training" / "house_cars" / f"flyer.{end}") for end in ("onnx", "json")]
RUN = ["evaluate", *CAR, "--track", "oval", "--rule", "max_simulated_ms=10000", "--json"]
DYING = """
import signal, sys
from paddock.cli import driving
from paddock.cli.showing import Speaker
from paddock.errors import PlatformFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules

def drive(job, folder):
    {}

signal.signal(signal.SIGCHLD, signal.SIG_IGN if "deaf" in sys.argv else signal.SIG_DFL)
driving.drive_at_home = drive
try:
    with driving.driven(driving.Where(by_slug("oval"), "official", RaceRules()), Speaker(True), cars=[]):
        pass
except PlatformFault as fault:
    print(driving.is_ready(), fault.code, fault.params["problem"])
"""
ORPHANED = """
import os, signal, sys
from paddock.cli import driving
from paddock.cli.showing import Speaker
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules

def drive(job, folder):
    os.write(int(sys.argv[1]), str(os.getpid()).encode())
    while True:
        os.write(1, b'{"progress": {"lap": 1, "laps": 1, "percent": 1}}\\n')

class Killed(Speaker):
    def progress(self, text, share=None):
        os.kill(os.getpid(), signal.SIGKILL)

driving.drive_at_home = drive
with driving.driven(driving.Where(by_slug("oval"), "official", RaceRules()), Killed(True), cars=[]):
    pass
"""


def command(*arguments, cwd=CHECKOUT, **environment):
    given = {**os.environ, **environment}
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, cwd=cwd, env=given)
    return done.returncode, done.stdout, done.stderr


def test_a_copy_drives_as_a_new_process_does(paddock):
    status, out, _ = command("-m", "paddock.cli", *RUN)
    other = paddock(*RUN)
    assert (status, json.loads(out)) == (other.status, other.json)
    assert status == 0 and not pinned.is_ready()


def test_a_closed_output_is_no_failure(tmp_path):
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-m", "paddock.cli", *RUN]
    done = subprocess.run([*shell, "--trace", str(tmp_path / "trace.csv")], cwd=CHECKOUT, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, b"") and (tmp_path / "trace.csv").stat().st_size > 1000


def test_a_refusal_is_the_same(paddock, tmp_path):
    (tmp_path / "car.onnx").write_bytes(b"nothing")
    broken = ["evaluate", str(tmp_path / "car.onnx"), CAR[1], "--track", "oval"]
    status, out, said = command("-m", "paddock.cli", *broken)
    other = paddock(*broken)
    assert status == other.status == 2 and out == other.out == ""
    assert said.strip().split("\n")[-1] == other.err.strip().split("\n")[-1]


@pytest.mark.parametrize("caller", ["", "deaf"])  # who ignores SIGCHLD, as the command then does, too
@pytest.mark.parametrize(
    ("end", "problem"),
    [
        ("raise OSError('no room')", "OSError: no room"),
        ("return 3", "exit status 3"),
        ("import os; os.kill(os.getpid(), 9)", "exit status -9"),
    ],
)
def test_a_copy_that_dies_is_said(end, problem, caller):
    environment = pinned.environment()
    assert is_pinned(environment)
    program = [*pinned.PYTHON, "-c", DYING.format(end), caller]
    done = subprocess.run(program, capture_output=True, text=True, cwd=CHECKOUT, env=environment)
    assert done.stdout == f"True drive_failed {problem}\n", done.stderr


def test_only_evaluations_that_ask_no_site_start_anew(monkeypatch):
    started = []
    monkeypatch.setattr("os.execve", lambda *arguments: started.append(arguments))
    asking = (["evaluate", "a.tar.gz", "--race", "may"], ["evaluate", "a.tar.gz", "--race=may"], ["verify", "abc"])
    for arguments in (["races"], [], ["evaluate", "--help"], *asking):
        monkeypatch.setattr(sys, "argv", ["paddock", *arguments])
        pinned.get_ready()
    assert [said[said.index("paddock.cli") :] for _, said, _ in started] == [["paddock.cli", "evaluate", "--help"]]


def test_files_beside_a_racers_models_are_not_taken_for_modules(tmp_path):
    for name in ("argparse", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a file of the racer was run')")
    script = "from paddock.cli.main import program; program()"  # as the installed one: its own folder is the path's
    status, out, said = command(*("-P", "-c", script, "evaluate", "--help"), cwd=tmp_path, PYTHONPATH=str(CHECKOUT))
    assert (status, said) == (0, "") and "--rival" in out


def test_a_copy_ends_with_the_command(tmp_path):
    reading, writing = os.pipe()
    done = subprocess.run(
        [*pinned.PYTHON, "-c", ORPHANED, str(writing)],
        cwd=CHECKOUT,
        env={**pinned.environment(), "TMPDIR": str(tmp_path)},
        pass_fds=[writing],
    )
    assert done.returncode == -signal.SIGKILL
    os.close(writing)
    with open(reading, "rb", buffering=0) as lives:
        copy = int(lives.read(20))
        try:
            assert select.select([lives], [], [], 60)[0] and lives.read(1) == b"", "it waits for a dead reader"
        except AssertionError:
            os.kill(copy, signal.SIGKILL)
            raise


@pytest.mark.skipif(compiled.library() is None, reason="no C compiler")
def test_what_is_compiled_at_the_first_drive_serves_it(tmp_path):
    without = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(CHECKOUT / "paddock", tmp_path / "paddock", ignore=without)
    job = {"track": "oval", "look": "official", "rules": RaceRules().to_dict(), "traces": []}
    (tmp_path / "job.json").write_text(json.dumps(job))
    script = (
        "import sys; from paddock.cli.child import main; main(*sys.argv[1:]);"
        "from paddock.simulator import cruise; from paddock.simulator.camera.warp import CompiledWarp as warp;"
        "print(cruise.__file__, warp.library is cruise._library is not None, file=sys.stderr)"
    )
    arguments = ("-P", "-c", script, str(tmp_path / "job.json"), str(tmp_path))
    _, _, said = command(*arguments, cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert said.split("\n")[-2] == f"{tmp_path}/paddock/simulator/cruise.py True"
