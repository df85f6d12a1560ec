"""A process started with the pins of :mod:`paddock.exact`, as sandboxed processes are."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from unittest import mock

from paddock import exact


@contextmanager
def pinned_process() -> Iterator[ProcessPoolExecutor]:
    """One that runs functions of modules that can be imported: ``process.submit(function, ...).result()``."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        with mock.patch.dict(os.environ, exact.environment(os.environ)):
            assert pool.submit(exact.is_pinned).result()  # started in this environment
        yield pool
