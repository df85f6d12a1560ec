"""Tests of a group run in one process (tests/groups.py): else each process makes anew what they share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytestmark = pytest.mark.xdist_group("together")


@pytest.mark.parametrize("number", range(6))
def test_a_group_runs_in_one_process(number):
    processes = Path(os.environ["PADDOCK_TEST_DATA"], "together")
    processes.mkdir(exist_ok=True)
    (processes / str(os.getpid())).touch()
    assert len(list(processes.iterdir())) == 1
