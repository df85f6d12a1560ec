"""Benchmarks as they are started by hand."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.shared import CHECKOUT


def run(module: str, *arguments: str, may_miss: bool = False, **begin_with: Path) -> str:
    """Standard output of ``python -m MODULE``, which ends with 1 where a promise is not kept. ``begin_with``: what it
    need not make itself (``BENCH_DATABASE``, ``BENCH_SITE``), where that is there."""
    found = {name: str(path) for name, path in begin_with.items() if path.exists()}
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=CHECKOUT,
        env={**os.environ, **found, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    # a program that breaks down ends with 1 as well, but prints nothing
    assert done.returncode == 0 or (may_miss and done.returncode == 1 and done.stdout), done.stderr[-3000:]
    return done.stdout
