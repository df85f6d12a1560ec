"""The same queue on PostgreSQL and Redis: the same tests, run again there."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests import servers
from tests.shared import CHECKOUT

FILES = [
    f"tests/evaluation/test_{name}.py" for name in ("states", "queue", "rivals", "work", "garage", "storm", "processes")
]
QUICK_ENOUGH = "not valkey or finishing or told"  # the brokers do not care which database it is


@pytest.mark.slow
@pytest.mark.postgres
@pytest.mark.redis
@pytest.mark.xdist_group("workers")
def test_the_queue_holds_on_postgresql_as_on_sqlite():
    with servers.short_folder() as folder, servers.postgres(folder) as url:
        inherited = {name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "PYTEST_"))}
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-k", QUICK_ENOUGH, *FILES],
            cwd=CHECKOUT,
            env={**inherited, "DATABASE_URL": url},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    assert done.returncode == 0, done.stdout[-8000:]
    assert " passed" in done.stdout and " skipped" not in done.stdout
