"""What processes count into files, and what a scrape makes of them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.multiprocess import MultiProcessCollector

import config.operations.metrics  # noqa: F401  has declared its gauges
from core import metrics
from core.metrics import DECLARED, Counter, Histogram
from tests.shared import CHECKOUT

BEGIN = """
import os, sys
from pathlib import Path
from django.conf import settings
settings.configure(METRICS=True, METRICS_DIR=Path(sys.argv[1]))
from core.metrics import Counter, Histogram
SEEN = Counter("seen_total", "Seen.", ("what",))
TIME = Histogram("time_seconds", "Time.", buckets=(1, 2))
"""


def started(folder: Path, code: str) -> subprocess.Popen:
    command = [sys.executable, "-c", BEGIN + code, str(folder)]
    return subprocess.Popen(command, cwd=CHECKOUT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def done(folder: Path, code: str) -> None:
    process = started(folder, code)
    process.communicate(timeout=60)
    assert process.returncode == 0


def value(folder: Path, name: str, **labels: str) -> float | None:
    registry = CollectorRegistry()
    MultiProcessCollector(registry, path=str(folder))
    return registry.get_sample_value(name, labels)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "metrics"


def test_the_counts_of_two_processes_at_once_are_added(folder):
    count = "SEEN.inc('car'); SEEN.inc('car', by=2); TIME.observe(1.5); print('ready', flush=True); sys.stdin.read()"
    both = [started(folder, count) for _ in range(2)]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    assert value(folder, "seen_total", what="car") == 6
    assert value(folder, "time_seconds_bucket", le="1.0") == 0
    assert value(folder, "time_seconds_bucket", le="2.0") == value(folder, "time_seconds_count") == 2
    for process in both:
        process.communicate(timeout=60)


def test_a_fork_adds_to_its_parents_counts(folder):
    done(folder, "SEEN.inc('car')\nif os.fork(): SEEN.inc('car'); os.wait()\nelse: SEEN.inc('car'); os._exit(0)")
    assert value(folder, "seen_total", what="car") == 3


def test_a_later_process_continues_the_files_of_one_that_ended(folder):
    for _ in range(3):
        done(folder, "SEEN.inc('car')")
    assert value(folder, "seen_total", what="car") == 3
    assert sorted(file.name for file in folder.glob("*.db")) == ["counter_0.db", "histogram_0.db"]


def test_the_files_are_the_owners_alone(folder):
    done(folder, "SEEN.inc('car')")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert {file.stat().st_mode & 0o777 for file in folder.iterdir()} == {0o600}


def test_a_full_disk_loses_counts_and_ends_no_process(folder):
    done(folder, "def full(*_): raise OSError(28, 'full')\nos.posix_fallocate = full\nSEEN.inc('car'); TIME.observe(1)")
    assert value(folder, "seen_total", what="car") is None


def test_the_blocks_of_the_files_are_on_the_disk(folder):
    """A write into a hole of a mapped file on a full disk would kill the process."""
    done(folder, "SEEN.inc('car')")
    for file in folder.glob("*.db"):
        assert file.stat().st_blocks * 512 >= file.stat().st_size == metrics.FILE_BYTES


def test_a_new_start_forgets_all_counts(folder, settings):
    settings.METRICS_DIR = folder
    done(folder, "SEEN.inc('car')")
    metrics.begin_anew()
    assert not folder.exists()


def test_nothing_is_counted_while_metrics_are_off(folder, settings):
    settings.METRICS, settings.METRICS_DIR = False, folder
    off, slow = Counter("off_total", "Off."), Histogram("off_seconds", "Off.")
    try:
        off.inc()
        slow.observe(1)
    finally:
        del DECLARED["off_total"], DECLARED["off_seconds"]
    assert off._made is slow._made is None and not folder.exists()


@pytest.mark.slow
def test_a_site_without_metrics_and_json_loads_no_library_for_them(tmp_path):
    libraries = {"prometheus_client", "structlog"}
    code = (
        f"import config.wsgi, config.celery, config.serving.streams.server, sys; print({libraries} & {{*sys.modules}})"
    )
    env = {"PATH": "/usr/bin:/bin", "PADDOCK_DATA": str(tmp_path), "PADDOCK_LOG_LEVEL": "ERROR"}
    found = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, env=env, capture_output=True, text=True)
    assert found.stdout == "set()\n", found.stderr


@pytest.mark.parametrize("name", sorted(DECLARED))
def test_names_follow_the_conventions_of_prometheus(name):
    metric = DECLARED[name]
    assert re.fullmatch(r"paddock_[a-z_]+", name)
    assert (metric.type == "counter") == name.endswith("_total")
    assert metric.type != "histogram" or name.endswith("_seconds")
    assert metric.meaning.endswith(".")
