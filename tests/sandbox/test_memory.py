"""How a policy process treats memory before and while a network of 23 MB comes in."""

from __future__ import annotations

import subprocess
import sys

from evaluation.sandbox.policy_process import rehearse

PAGE = 4096
COPY = 24 * 1024 * 1024
# Two copies are made and given back, then two more: how many new pages do these take?
COPIES = f"""
import os
import resource
from evaluation.sandbox.policy_process import fetch_memory, keep_freed_memory

requests, ask = os.pipe()

def new_pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    copies = [b"x" * {COPY} for _ in range(2)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

BEFORE
print(new_pages())
"""


def new_pages(*before: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", COPIES.replace("BEFORE", "\n".join(before))],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    return int(done.stdout)


def test_freed_memory_is_used_again() -> None:
    whole = 2 * COPY // PAGE
    assert new_pages("keep_freed_memory()", "new_pages()") < whole / 20
    assert new_pages("new_pages()") > whole / 2, "this C library keeps it by itself: the function is of no use any more"


def test_memory_is_fetched_before_the_network_arrives() -> None:
    assert new_pages("keep_freed_memory()", "fetch_memory(requests)") < 2 * COPY // PAGE / 20


def test_a_pending_request_does_not_wait_for_memory() -> None:
    fetched = "before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt", "fetch_memory(requests)"
    asked = "import sys", "os.write(ask, b'x')", *fetched
    count = "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)", "sys.exit()"
    assert new_pages(*asked, *count) < 100


def test_what_every_network_meets_is_met_once() -> None:
    rehearse()  # where it fails nobody hears of it
