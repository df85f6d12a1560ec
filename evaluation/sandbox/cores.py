"""One core for one evaluation, because the referee and the model take turns.

A round trip over the two pipes takes 45 us on one core and 105 us on two. When all cores are claimed, evaluations
queue; only the first of them polls for a free core. After its patience an evaluation runs beside the others.
"""

import contextlib
import os
import time
from collections.abc import Callable, Iterable, Iterator

from .claims import Candidate, Claim, claim

PATIENCE_S = 20.0
_FIRST = "next-core"  # its holder is the first in the queue
_LOOK_S, _BEHIND_S, _WAITING_S = 0.005, 0.1, 0.25


@contextlib.contextmanager
def one_core(
    pids: Iterable[int | None], patience_s: float = 0.0, waiting: Callable[[], None] = lambda: None
) -> Iterator[int | None]:
    """Move the processes to one claimed core while the context lasts. Yields its number, None if none is free for
    ``patience_s``. ``waiting`` is called four times a second meanwhile; its exceptions pass through."""
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
    """A free core; None where all are taken. Raises OSError where none can be claimed."""
    for core in sorted(os.sched_getaffinity(0)):
        held = claim(f"core-{core}")
        if held is not None:
            stack.enter_context(held)
            return core
    return None


def _wait(stack: contextlib.ExitStack, patience_s: float, waiting: Callable[[], None]) -> int | None:
    """The core that is free first; None after ``patience_s``."""
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
                tell = now + _WAITING_S
            time.sleep(_BEHIND_S if is_first is None else _LOOK_S)
            now = time.monotonic()
    return None
