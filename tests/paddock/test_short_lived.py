"""The quick end of a short-lived process."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest

from tests.shared import CHECKOUT

PROGRAM = """
import atexit
from paddock.short_lived import leave

class Kept:
    def __del__(self):
        print("freed")

kept = Kept()
atexit.register(print, "registered")
print("written")
leave(3)
"""


def run(**options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", PROGRAM], cwd=CHECKOUT, text=True, stderr=subprocess.PIPE, **options)


def test_it_writes_all_and_frees_nothing() -> None:
    done = run(stdout=subprocess.PIPE)
    assert (done.returncode, done.stdout, done.stderr) == (3, "written\nregistered\n", "")


@pytest.mark.parametrize("buffering", ["", "1"])
def test_output_that_nobody_reads_is_no_success(buffering: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = run(stdout=writing, env={**os.environ, "PYTHONUNBUFFERED": buffering})
    os.close(writing)
    assert done.returncode not in (0, 3) and "BrokenPipeError" in done.stderr
