"""Forks that work until nothing is left, and of which many are killed: for each of these another takes its place."""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Callable
from itertools import count


def ride_out(workers: int, work: Callable[[], None], luck: random.Random) -> None:
    """Keep so many forks at work, each with luck of its own, until all have ended. Each prints its exit status; what
    one raises ends it as any program: said, and with exit status 1."""
    seeds = count(1)
    for _ in range(workers):
        _start(next(seeds), work, luck)
    while workers:
        _, status = os.wait()
        code = os.waitstatus_to_exitcode(status)
        print(f"exit {code}", flush=True)
        if code == -signal.SIGKILL:
            _start(next(seeds), work, luck)
        else:
            workers -= 1


def _start(seed: int, work: Callable[[], None], luck: random.Random) -> None:
    if os.fork():
        return
    luck.seed(seed)
    work()
    os._exit(0)
