"""The processor time of commands, beside another checkout."""

from __future__ import annotations

import json
import shutil

import pytest

from benchmarks import commands
from tests.benchmarks.running import run
from tests.shared import CHECKOUT


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("perf") is None, reason="perf is not installed")
def test_a_command_is_measured_in_both_checkouts() -> None:
    options = ("--json", "--runs", "1", "--commands", "help", "--beside", str(CHECKOUT))
    figures = json.loads(run("benchmarks.commands", *options))
    own, beside = figures["processor_ms"]["paddock --help"]
    assert own > 10 and beside > 10
    assert "100%" in commands.table({**figures, "processor_ms": {"paddock --help": [own, own]}})
