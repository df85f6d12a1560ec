"""In a plain container, whose seccomp profile refuses namespaces, models run at the best level there is."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from evaluation.sandbox.probe import FILTERED
from tests.shared import CHECKOUT

REPORT = """
import json
from evaluation.sandbox.probe import probe
print(json.dumps(probe().to_dict()))
"""
CHECKED = """
import json
from training.rewards.validation import check_reward
good = "def reward_function(params):\\n    return 1.0\\n"
print(json.dumps([check_reward(good).rewards["start"], len(check_reward("import os").problems)]))
"""
THREADED = """
import json
from evaluation.sandbox.start import LEVEL_LOCK, start
from evaluation.sandbox.limits import PROBE
with start("has_a_thread", PROBE, LEVEL_LOCK, python_path=["tests/sandbox/payloads"]) as process:
    print(json.dumps([process.wait(10), process.stderr_text().strip().splitlines()[-1]]))
"""


def inside(program: str):
    """What a program prints that runs under such a profile, as JSON."""
    command = [sys.executable, "-m", "tests.sandbox.plain_container", "-c", program]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def report():
    return inside(REPORT)


def test_the_lock_is_available(report):
    assert (report["level"], report["sufficient"]) == (2, True), report


def test_the_report_names_the_true_reason(report):
    (missing,) = [layer for layer in report["layers"] if not layer["available"]]
    assert missing["name"] == "namespaces"
    assert missing["detail"].endswith(FILTERED) and "thread" not in missing["detail"]
    assert "In a container" in FILTERED
    assert "**In a container**" in (CHECKOUT / "docs" / "operators.md").read_text()


def test_untrusted_code_runs_behind_the_lock():
    assert inside(CHECKED) == [1.0, 2]


def test_a_second_thread_is_still_detected():
    """There the kernel's own answer cannot be had, and the threads are counted."""
    status, said = inside(THREADED)
    assert status == 70 and said.endswith("a thread is already running")
