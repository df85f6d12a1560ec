"""The two walled-off processes of an evaluation: the policy, and the runner that asks it.

Starting two interpreters takes a fifth of a second and more, as long as a short race. A worker with nothing to do
therefore keeps one pair ready (:class:`Spare`). Every pair drives one job and is then killed, however it was started.
"""

from __future__ import annotations

import contextlib
import logging

from faults import PlatformFault

from .sandbox.launch import SandboxedProcess, launch
from .sandbox.limits import RUNNER
from .sandbox.policy import PolicyProcess

RUNNER_MODULE = "evaluation.runner_process"

logger = logging.getLogger(__name__)


class Pair:
    """A policy process and a runner process, connected, without a job. A context manager: leaving kills both.

    ``level``: as for :func:`evaluation.sandbox.launch.launch`. Raises PlatformFault where they cannot be started.
    """

    def __init__(self, level: int | None = None) -> None:
        with contextlib.ExitStack() as stack:
            self.policy = stack.enter_context(PolicyProcess(level=level))
            pipes = (self.policy.process.stdout, self.policy.process.stdin)
            self.runner: SandboxedProcess = stack.enter_context(
                launch(RUNNER_MODULE, limits=RUNNER, level=level, arguments=[str(fd) for fd in pipes], pass_fds=pipes)
            )
            self._stack = stack.pop_all()

    def __enter__(self) -> Pair:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether neither process has ended."""
        return self.policy.process.poll() is None and self.runner.poll() is None

    def close(self) -> None:
        """Kill both and give everything back. Does nothing the second time."""
        self._stack.close()


class Spare:
    """At most one pair that waits for a job. It belongs to the thread that makes it: with that thread it dies."""

    def __init__(self) -> None:
        self._pair: Pair | None = None

    def prepare(self) -> None:
        """Start a pair unless one waits already. One that cannot be started is logged: the next job will say why."""
        if self._pair is not None and self._pair.alive:
            return
        self.close()
        try:
            self._pair = Pair()
        except PlatformFault as fault:
            logger.warning("No pair of processes can be kept ready: %s", fault)

    def take(self) -> Pair | None:
        """The waiting pair, which is the caller's from now on; None when there is none, or it has died meanwhile."""
        pair, self._pair = self._pair, None
        if pair is not None and not pair.alive:
            pair.close()
            return None
        return pair

    def close(self) -> None:
        """Kill the waiting pair, if there is one."""
        if self._pair is not None:
            self._pair.close()
            self._pair = None
