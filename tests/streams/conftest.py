"""One stream process and one bell for all tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from django.utils import timezone

from config.serving import broker
from core.wakeups import streams as ringing
from tests.evaluation.processes import wait_for
from tests.servers import short_folder, valkey
from tests.streams.process import Streams

PER_RACER, PER_ADDRESS = 3, 40


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with short_folder() as made:
        yield made


class Broker:
    """A Valkey that can be away for a while."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._runs = folder, ExitStack()

    @property
    def url(self) -> str:
        return broker.cache_url(broker.socket_path(self._folder))

    def start(self) -> None:
        self._runs.enter_context(valkey(self._folder))

    def stop(self) -> None:
        self._runs.close()


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Broker]:
    (folder / "bell").mkdir()
    made = Broker(folder / "bell")
    made.start()
    yield made
    made.stop()


@pytest.fixture(scope="module")
def bell(server: Broker) -> str:
    return server.url


@pytest.fixture(scope="module")
def process(folder: Path, bell: str, django_db_setup: None, django_db_blocker) -> Iterator[Streams]:
    (folder / "data").mkdir()
    with django_db_blocker.unblock():
        limits = {"PADDOCK_STREAMS_PER_RACER": str(PER_RACER), "PADDOCK_STREAMS_PER_ADDRESS": str(PER_ADDRESS)}
        streams = Streams(folder / "data", bell, **limits)
    streams.start()
    yield streams
    if streams.process is not None:
        streams.end()


@pytest.fixture
def streams(process: Streams, transactional_db: None, settings, bell: str, monkeypatch, wakes) -> Streams:
    """The process, alive and knowing the table of this test; what is written here rings for it."""
    settings.STREAM_BELL_URL = bell
    monkeypatch.setattr(ringing, "_server", None)
    monkeypatch.setattr(ringing, "_away_until", 0.0)
    if process.process is None:
        process.start()
    wait_for(process.is_up_to_date, 20, process.log)
    return process


@pytest.fixture
def now():
    return timezone.now()
