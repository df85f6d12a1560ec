"""From inside: what a process in the sandbox tries, and that the sandbox refuses it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import POLICY
from tests.shared import CHECKOUT

from .conftest import PAYLOADS
from .payloads.attempts import attempts

NAMES = list(attempts({"database": "", "media": "", "directory": ""}))

# What works on any Linux without a sandbox, so that a refusal means something.
SOUND = [
    "read the password file",
    "read the database",
    "read another racer's upload",
    "list the media folder",
    "see whether the database exists",
    "list the root directory",
    "read its own environment again",
    "list processes",
    "import another module",
    "write to /tmp",
    "write beside the database",
    "open a TCP socket",
    "open a UDP socket",
    "open a unix socket",
    "open a pair of sockets",
    "open a netlink socket",
    "make a pipe",
    "fork",
    "fork twice and detach",
    "spawn a program",
    "clone",
    "clone3",
    "start threads",
    "make a file in memory",
    "map executable memory",
    "make memory executable",
    "ask whether the parent lives",
    "signal a thread of the parent",
    "open the parent as a descriptor",
    "make shared memory",
    "choose its processor",
]


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """A database, an upload and their folder, readable by everybody as far as the file system goes."""
    directory = tmp_path_factory.mktemp("data")
    for parent in (directory, *directory.parents):
        if parent.is_relative_to("/tmp") and str(parent) != "/tmp":
            parent.chmod(0o755)
    made = {"database": str(directory / "db.sqlite3"), "media": str(directory / "model.onnx")}
    for path in made.values():
        with open(path, "w") as file:
            file.write("secret")
        os.chmod(path, 0o666)
    return {**made, "directory": str(directory)}


@pytest.fixture(scope="module")
def outcomes(level, paths):
    """What came of every attempt in the sandbox."""
    with launch("attempts", limits=POLICY, python_path=[PAYLOADS], level=level) as process:
        write_message(process.stdin, {"paths": paths}, deadline=process.deadline)
        message, _ = read_message(process.stdout, process.deadline)
        return message["outcomes"]


def test_the_sandbox_blocks_every_attempt(outcomes):
    assert [name for name in NAMES if outcomes[name] == "open"] == []


def test_every_attempt_ran_and_none_was_fatal(outcomes):
    assert list(outcomes) == NAMES


def test_the_attempts_left_no_trace_on_the_host(outcomes, paths):
    assert sorted(os.listdir(paths["directory"])) == ["db.sqlite3", "model.onnx"]
    with open(paths["database"]) as file:
        assert file.read() == "secret"
    assert not [name for name in os.listdir("/tmp") if name.startswith("paddock-escape")]


def test_the_same_attempts_succeed_without_the_sandbox(paths):
    code = f"import sys; from attempts import try_all; print(try_all({paths!r}, {SOUND!r}))"
    environment = {"PYTHONPATH": f"{CHECKOUT}{os.pathsep}{PAYLOADS}", "PATH": os.environ["PATH"]}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=True
    )
    closed = {name: outcome for name, outcome in eval(done.stdout).items() if outcome != "open"}
    assert closed == {}
