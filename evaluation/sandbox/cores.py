"""One core for one evaluation: its referee and its model take turns, and turns are cheapest on the same core.

Measured: a round trip over the two pipes takes 45 us on one core, 105 us and more on two (the other core has to be
woken each time). A core is claimed (:mod:`.claims`), so that evaluations that run at the same time take different ones.

When all are taken, an evaluation waits for its turn: two that share a core interrupt each other at every question to a
network, find the caches full of the other's things, and take two fifths more of the processor, both of them. Those who
wait stand in a row. Only the first looks for a core again and again, as soon as it can be free: who looks takes the
processor from those who drive. One that waited in vain (others drive long races) runs beside them, and the kernel
places its processes.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterable, Iterator

from .claims import Candidate, Claim, claim

PATIENCE_S = 20.0
_FIRST = "next-core"  # who has it is the first of those who wait
_LOOK_S, _BEHIND_S, _TOLD_S = 0.004, 0.02, 0.25


@contextlib.contextmanager
def one_core(
    pids: Iterable[int | None], patience_s: float = 0.0, waiting: Callable[[], None] = lambda: None
) -> Iterator[int | None]:
    """Move the processes to one claimed core while the context lasts. Yields its number, None if none is free for
    ``patience_s``. ``waiting`` is called four times a second meanwhile; what it raises goes through."""
    with contextlib.ExitStack() as stack:
        core = None
        with contextlib.suppress(OSError):  # no folder is private here: only speed is lost
            core = _claim(stack) if patience_s <= 0.0 else _wait(stack, patience_s, waiting)
        if core is not None:
            for pid in pids:
                if pid is not None:
                    with contextlib.suppress(OSError):  # it is gone, or this container may not: only speed is lost
                        os.sched_setaffinity(pid, {core})
        yield core


def _claim(stack: contextlib.ExitStack) -> int | None:
    """A core that nobody has; None where all are taken. Raises OSError where none can be claimed."""
    for core in sorted(os.sched_getaffinity(0)):
        held = claim(f"core-{core}")
        if held is not None:
            stack.enter_context(held)
            return core
    return None


def _wait(stack: contextlib.ExitStack, patience_s: float, waiting: Callable[[], None]) -> int | None:
    """The same when it is this one's turn; None where that does not come for so long."""
    with contextlib.ExitStack() as row:
        numbers = sorted(os.sched_getaffinity(0))
        cores = {core: row.enter_context(Candidate(f"core-{core}")) for core in numbers}
        first = row.enter_context(Candidate(_FIRST))
        is_first: Claim | None = None
        now = time.monotonic()
        until, tell = now + patience_s, now
        while now < until:
            if is_first is None and (is_first := first.claim()) is not None:
                row.enter_context(is_first)
            if is_first is not None:
                for core, candidate in cores.items():
                    if (held := candidate.claim()) is not None:
                        stack.enter_context(held)
                        return core
            if now >= tell:
                waiting()
                tell = now + _TOLD_S
            time.sleep(_BEHIND_S if is_first is None else _LOOK_S)
            now = time.monotonic()
    return None
