"""Metrics for Prometheus. Unless ``settings.METRICS``, nothing is counted and no library is loaded.

Each process counts into files of its own in ``settings.METRICS_DIR`` (prometheus_client's multiprocess mode), and a
scrape (:mod:`config.operations.metrics`) adds them up.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import threading
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from django.conf import settings

if TYPE_CHECKING:
    from prometheus_client.core import GaugeMetricFamily

FILE_BYTES = 1 << 20
_making = threading.Lock()
_held: tuple[int, int, str] | None = None  # the process, its lock, and the name of its files


class Metric:
    """A metric by name, with what it means and the names of its labels, which never hold anything of a racer."""

    type: ClassVar[str]

    def __init__(self, name: str, meaning: str, labels: Sequence[str] = (), **options: Any) -> None:
        self.name, self.meaning, self.labels, self._options = name, meaning, tuple(labels), options
        self._made: Any = None
        self._children: dict[tuple[str, ...], Any] = {}
        DECLARED[name] = self

    def _child(self, values: tuple[str, ...]) -> Any:
        child = self._children.get(values)
        if child is None:
            with _making:
                if self._made is None:
                    make = getattr(client(), self.type.capitalize())
                    self._made = make(self.name, self.meaning, self.labels, **self._options)
                child = self._children[values] = self._made.labels(*values) if values else self._made
        return child


DECLARED: dict[str, Metric] = {}


class Counter(Metric):
    type = "counter"

    def inc(self, *values: str, by: float = 1.0) -> None:
        """Count. ``values``: of the labels."""
        if settings.METRICS:
            with suppress(OSError):  # of a full disk: that is not counted
                self._child(values).inc(by)


class Histogram(Metric):
    type = "histogram"

    def observe(self, amount: float, *values: str) -> None:
        """Count an amount, in seconds. ``values``: of the labels."""
        if settings.METRICS:
            with suppress(OSError):
                self._child(values).observe(amount)


class Gauge(Metric):
    """A value that a scrape reads from where it is."""

    type = "gauge"

    def family(self) -> GaugeMetricFamily:
        from prometheus_client.core import GaugeMetricFamily

        return GaugeMetricFamily(self.name, self.meaning, labels=self.labels)


def begin_anew() -> None:
    """Forget all counts. No process of the site may run."""
    shutil.rmtree(settings.METRICS_DIR, ignore_errors=True)


@cache
def client() -> Any:
    """The library, loaded with the first use."""
    os.environ["PROMETHEUS_MULTIPROC_DIR"] = str(settings.METRICS_DIR)
    import prometheus_client
    from prometheus_client import values

    values.ValueClass = values.MultiProcessValue(_files_of_process)
    return prometheus_client


def _files_of_process() -> str:
    """The name of this process's files: the first that no living process has. It adds to the counts of the processes
    that had it before, so there are as many files as processes at once. Raises OSError."""
    global _held
    if _held is None or _held[0] != os.getpid():
        _held = _take_files()
    return _held[2]


def _take_files() -> tuple[int, int, str]:
    settings.METRICS_DIR.mkdir(mode=0o700, exist_ok=True)
    for number in count():
        lock = os.open(settings.METRICS_DIR / f"{number}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # a fork does not hold its parent's
        except OSError:
            os.close(lock)
            continue
        for kind in (Counter, Histogram):
            _allocate(settings.METRICS_DIR / f"{kind.type}_{number}.db")
        return os.getpid(), lock, str(number)
    raise AssertionError("unreachable")


def _allocate(path: Path) -> None:
    """Make a file whose blocks are on the disk: a process that writes into a hole of a mapped file on a full disk is
    killed (SIGBUS)."""
    if path.exists():
        return
    new = path.with_suffix(".new")
    file = os.open(new, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        os.posix_fallocate(file, 0, FILE_BYTES)
    finally:
        os.close(file)
    new.rename(path)
