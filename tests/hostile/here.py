"""A sandboxed process without the process: its ``main`` in a thread of ours, over the same two pipes.

What it answers is the same, and no interpreter starts, imports and locks itself for it. What a wall alone can stop
(memory, time, a crash) is not for this.
"""

from __future__ import annotations

import importlib
import os
import time
from threading import Thread
from typing import Any

from evaluation.sandbox.limits import Limits
from evaluation.sandbox.process import SandboxedProcess


class Here:
    """In the place of a ``SandboxedProcess``."""

    wait_for_lock = SandboxedProcess.wait_for_lock

    def __init__(self, module: str, *, limits: Limits, **_more: object) -> None:
        self.deadline = time.monotonic() + limits.wall_s
        self._theirs_in, self.stdin = os.pipe()
        self.stdout, self._theirs_out = os.pipe()
        self._main = importlib.import_module(module).main
        self._thread = Thread(target=self._run, daemon=True)
        os.set_blocking(self.stdin, False)
        os.set_blocking(self.stdout, False)

    def _run(self) -> None:
        try:
            self._main(self._theirs_in, self._theirs_out)
        finally:
            os.close(self._theirs_out)  # whoever waits for an answer hears that none comes

    def __enter__(self) -> Here:
        self._thread.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        os.close(self.stdin)
        os.close(self.stdout)
        self._thread.join()
        os.close(self._theirs_in)

    def widen_pipes(self) -> None:
        """Nothing: both ends are read while the other one writes."""

    def wait(self, _timeout: float | None = None) -> int:
        """As if it had ended by itself."""
        return 1

    def stderr_text(self) -> str:
        """Nothing: what it raises, pytest tells."""
        return ""


def launch_here(module: str, **options: Any) -> Here:
    """In the place of ``evaluation.sandbox.launch.launch``."""
    return Here(module, **options)
