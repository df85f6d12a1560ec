"""The sandboxed processes of an evaluation: a policy for each submitted car, and the runner.

Starting two interpreters takes a fifth of a second. An idle worker therefore keeps a pool for one car ready, which has
rehearsed on the latest tracks (:class:`SparePool`). Every pool drives one job and is then killed.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Sequence

from paddock import exact
from paddock.errors import PlatformFault

from ..sandbox.frames import FrameError, write_message
from ..sandbox.launch import launch
from ..sandbox.limits import RUNNER
from ..sandbox.policy import PolicyProcess, failed_start
from ..sandbox.process import SandboxedProcess, widen_pipe
from .race_setup import Venue

RUNNER_MODULE = "evaluation.running.runner_process"
DRIVES_MODULE = "evaluation.running.drives_process"  # many laps of one car
VENUES_KEPT = 3  # a large track is 30 MB in a runner that has prepared it
SPARE_KEPT_S = 60.0
_START_S = 30.0

logger = logging.getLogger(__name__)


class ProcessPool:
    """A policy process for each of ``cars`` and a runner process that has the pipes of all of them, without a job.

    A context manager: leaving kills all. ``level``: as for :func:`evaluation.sandbox.launch.launch`. ``venues``: where
    the job may be, for the runner to prepare. ``module``: what the runner runs. Raises PlatformFault where they cannot
    be started.
    """

    def __init__(
        self,
        cars: int = 1,
        level: int | None = None,
        venues: Sequence[Venue] = (),
        module: str = RUNNER_MODULE,
    ) -> None:
        self._level = level
        self._module = module
        self.policies: list[PolicyProcess] = []
        self._venues = list(venues)
        with contextlib.ExitStack() as stack:
            self.runner = self._start(stack, cars)
            if venues:
                self._tell_of_venues()
                for policy in self.policies:
                    policy.get_ready()
            self._stack = stack.pop_all()

    def __enter__(self) -> ProcessPool:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        return all(process.poll() is None for process in (self.runner, *(policy.process for policy in self.policies)))

    def enlist(self, cars: int) -> None:
        """Start the policies that are missing, and a new runner that knows them all. Raises PlatformFault; what was
        started before is then still to be closed."""
        if cars > len(self.policies):
            before, self.runner = self.runner, self._start(self._stack, cars)
            self._venues = []
            before.close()

    def described(self, venue: Venue) -> dict[str, object]:
        """The venue in a job's message: the index of one that the runner has prepared, or all its data."""
        return {"prepared": self._venues.index(venue)} if venue in self._venues else {"venue": venue.to_dict()}

    def close(self) -> None:
        """Kill all and give everything back. Does nothing the second time."""
        self._stack.close()

    def _tell_of_venues(self) -> None:
        widen_pipe(self.runner.stdin)  # the runner reads when it has imported everything; nobody waits for that
        try:
            write_message(
                self.runner.stdin,
                {"venues": [venue.to_dict() for venue in self._venues]},
                deadline=time.monotonic() + _START_S,
            )
        except FrameError as error:
            raise failed_start(self.runner, str(error)) from None

    def _start(self, stack: contextlib.ExitStack, cars: int) -> SandboxedProcess:
        while len(self.policies) < cars:
            self.policies.append(stack.enter_context(PolicyProcess(level=self._level)))
        ends = [
            fd for policy in self.policies for fd in (policy.process.stdout, policy.process.stdin, policy.memory_fd)
        ]
        return stack.enter_context(
            launch(
                self._module,
                limits=RUNNER,
                level=self._level,
                memory=exact.LARGE_AND_KEPT,
                arguments=[str(fd) for fd in ends],
                pass_fds=[fd for fd in ends if fd >= 0],
            )
        )


class SparePool:
    """At most one pool for one car that waits for a job, prepared for the latest venues. It ends with the thread that
    called :meth:`prepare`, and after :data:`SPARE_KEPT_S` without a job: it takes 200 MB."""

    def __init__(self, kept_s: float = SPARE_KEPT_S) -> None:
        self._pool: ProcessPool | None = None
        self._kept_s = kept_s
        self._timer: threading.Timer | None = None
        self._lock = threading.RLock()
        self._venues: list[Venue] = []  # the last first

    def prepare(self) -> None:
        """Start a pool unless one waits already. One that cannot be started is logged: the next job will say why."""
        with self._lock:
            if self._pool is None or not self._pool.alive:
                self.close()
                try:
                    self._pool = ProcessPool(venues=self._venues)
                except PlatformFault as fault:
                    logger.warning("No processes can be kept ready: %s", fault)
                    return
            self._cancel_timer()
            self._timer = threading.Timer(self._kept_s, self.close)
            self._timer.daemon = True
            self._timer.start()

    def take(self, venue: Venue) -> ProcessPool | None:
        """The waiting pool for a job at ``venue``, now the caller's; None when there is none, or it has died."""
        self._venues = [venue, *(other for other in self._venues if other != venue)][:VENUES_KEPT]
        with self._lock:
            self._cancel_timer()
            pool, self._pool = self._pool, None
        if pool is not None and not pool.alive:
            pool.close()
            return None
        return pool

    def close(self) -> None:
        with self._lock:
            self._cancel_timer()
            if self._pool is not None:
                self._pool.close()
                self._pool = None

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
