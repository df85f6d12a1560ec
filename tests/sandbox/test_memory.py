"""How a policy process treats memory while a network of 23 MB comes in."""

from __future__ import annotations

import subprocess
import sys

PAGE = 4096
COPY = 24 * 1024 * 1024
# Two copies are made and given back, then two more: how many new pages do these take?
COPIES = f"""
import resource
from evaluation.sandbox.policy_process import keep_freed_memory

def new_pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    copies = [b"x" * {COPY} for _ in range(2)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

KEEP
new_pages()
print(new_pages())
"""


def new_pages(keep: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", COPIES.replace("KEEP", keep)], check=True, capture_output=True, text=True, timeout=60
    )
    return int(done.stdout)


def test_memory_that_was_given_back_is_used_again() -> None:
    whole = 2 * COPY // PAGE
    assert new_pages("keep_freed_memory()") < whole / 20
    assert new_pages("") > whole / 2, "this C library keeps it by itself: the function is of no use any more"
