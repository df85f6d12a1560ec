"""Benchmarks as they are started by hand."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.shared import CHECKOUT


def run(module: str, *arguments: str, may_miss: bool = False) -> str:
    """Standard output of ``python -m MODULE``, which ends with 1 where a promise is not kept."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=CHECKOUT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    # a program that breaks down ends with 1 as well, but prints nothing
    assert done.returncode == 0 or (may_miss and done.returncode == 1 and done.stdout), done.stderr[-3000:]
    return done.stdout
