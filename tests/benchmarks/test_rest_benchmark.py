"""The benchmark of memory at rest: what it adds up, and what it calls a miss."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from benchmarks import rest


def of(mb: float, ratio: float) -> dict:
    return {
        "load_s": 1.0,
        "ready_s": 2.0,
        "all_parts_s": 2.5,
        "processor_s": ratio,
        "ratio": ratio,
        "processes": 3,
        "mb": mb,
        "programs": {"web": mb},
    }


def test_too_much_memory_or_a_slow_start_is_a_miss() -> None:
    found = {"with training": of(401.0, 2.9), "without training": of(299.0, 3.1), "machine": {"load": [0.1, 0.2]}}
    assert rest.misses(found) == [
        "with training: 401 MB at rest",
        "without training: a later start takes 3.1 times the loading of the site",
    ]
    assert "without training: 299 MB in 3 processes" in rest.table(found)
    assert rest.misses({"without training": of(299.0, 2.9)}) == []  # where no training is installed


def test_the_whole_family_is_added_up() -> None:
    waits = "import sys; sys.stdout.write('.'); sys.stdout.flush(); sys.stdin.read()"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {waits!r}])"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None and parent.stdin is not None
        parent.stdout.read(1)
        family = rest._family(parent.pid)
        parent.stdin.close()
    assert len(family) == 2 and all(1.0 < mb < 100.0 for _, mb in family)
    assert os.getpid() not in rest._pids(parent.pid)


@pytest.mark.parametrize(
    ("command", "program"),
    [
        ("python manage.py run --port 8000", "supervisor"),
        ("python -m celery --quiet --app config worker --pool threads --queues messages --with-scheduler", "messenger"),
        ("python -m celery --quiet --app config worker --pool threads --concurrency 1 --without-mingle", "worker"),
        ("/usr/bin/bwrap --unshare-ipc", "sandbox"),
    ],
)
def test_a_process_counts_for_its_program(command: str, program: str) -> None:
    assert rest._by_program([(command, 2.0), (command, 3.0)]) == {program: 5.0}
