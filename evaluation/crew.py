"""The sandboxed processes of an evaluation: a policy for each submitted car, and the runner that asks them.

Starting two interpreters takes a fifth of a second and more, as long as a short race, and building up a track another
thirtieth. A worker with nothing to do therefore keeps a crew for one car ready, which has rehearsed on the tracks that
were raced last (:class:`Spare`). Every crew drives one job and is then killed, however it was started.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Sequence
from typing import Any

from paddock.errors import PlatformFault

from .sandbox.frames import FrameError, write_message
from .sandbox.launch import SandboxedProcess, launch, widen_pipe
from .sandbox.limits import RUNNER
from .sandbox.policy import PolicyProcess, failed_start
from .venue import Venue

RUNNER_MODULE = "evaluation.runner_process"
DRIVES_MODULE = "evaluation.drives_process"  # many laps of one car
VENUES_KEPT = 3  # a large track is 30 MB in a runner that has prepared it
_START_S = 30.0

logger = logging.getLogger(__name__)


class Crew:
    """A policy process for each of ``cars`` and a runner process that has the pipes of all of them, without a job.

    Each policy has its own sandbox and shares nothing with the others. A context manager: leaving kills all.
    ``level``: as for :func:`evaluation.sandbox.launch.launch`. ``venues``: where the job may be, which the runner gets
    ready for while it waits. ``module``: what the runner runs. Raises PlatformFault where they cannot be started.
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

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether no process has ended."""
        return all(process.poll() is None for process in (self.runner, *(policy.process for policy in self.policies)))

    def enlist(self, cars: int) -> None:
        """Start the policies that are missing, and then a runner that knows them all in place of the present one.

        Raises PlatformFault; what was started before is then still to be closed.
        """
        if cars > len(self.policies):
            before, self.runner = self.runner, self._start(self._stack, cars)
            self._venues = []
            before.close()

    def described(self, venue: Venue) -> dict[str, Any]:
        """The part of a job's message that says where the race is: one of the runner's venues, or all about it."""
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
                arguments=[str(fd) for fd in ends],
                pass_fds=[fd for fd in ends if fd >= 0],
            )
        )


class Spare:
    """At most one crew for one car that waits for a job, prepared for the venues of the last jobs. It belongs to the
    thread that makes it: with that thread it dies."""

    def __init__(self) -> None:
        self._crew: Crew | None = None
        self._venues: list[Venue] = []  # the last first

    def prepare(self) -> None:
        """Start a crew unless one waits already. One that cannot be started is logged: the next job will say why."""
        if self._crew is not None and self._crew.alive:
            return
        self.close()
        try:
            self._crew = Crew(venues=self._venues)
        except PlatformFault as fault:
            logger.warning("No processes can be kept ready: %s", fault)

    def take(self, venue: Venue) -> Crew | None:
        """The waiting crew, which is the caller's from now on, for a job at ``venue``; None when there is none, or it
        has died meanwhile."""
        self._venues = [venue, *(other for other in self._venues if other != venue)][:VENUES_KEPT]
        crew, self._crew = self._crew, None
        if crew is not None and not crew.alive:
            crew.close()
            return None
        return crew

    def close(self) -> None:
        """Kill the waiting crew, if there is one."""
        if self._crew is not None:
            self._crew.close()
            self._crew = None
