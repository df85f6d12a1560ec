"""Freed memory that a process keeps."""

from __future__ import annotations

import subprocess
import sys

from tests.shared import CHECKOUT

PAGES_OF_A_REQUEST = 40 * 90_000 // 4096
# How many pages does the second request fetch whose memory is given back after each of twenty steps?
REQUESTS = """
import resource
from config.serving.web import prepare_memory

def request():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        held = [bytes(90_000) for _ in range(40)]
        del held
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

BEFORE
request()
print(request())
"""


def pages_fetched(before: str) -> int:
    command = [sys.executable, "-c", REQUESTS.replace("BEFORE", before)]
    done = subprocess.run(command, cwd=CHECKOUT, check=True, capture_output=True, text=True, timeout=60)
    return int(done.stdout)


def test_a_web_process_uses_freed_memory_again() -> None:
    assert pages_fetched("prepare_memory()") < PAGES_OF_A_REQUEST / 20
    assert pages_fetched("") > PAGES_OF_A_REQUEST, (
        "this C library keeps it by itself: prepare_memory() need not ask for it"
    )
