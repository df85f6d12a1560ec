"""The cache goes on in the process's own memory while its server is away, and says so once."""

from __future__ import annotations

import logging

import pytest
from redis import ConnectionError as NobodyThere
from redis import ResponseError

from config.serving import cache as steady
from config.serving.cache import SteadyCache


class Server:
    """Django's cache for Redis, as far as a test needs it; ``fault`` is what it raises."""

    def __init__(self) -> None:
        self.kept: dict = {}
        self.fault: Exception | None = None
        self.asked = 0

    def __getattr__(self, name: str):
        def ask(key: str, *values: object, **options: object):
            self.asked += 1
            if self.fault is not None:
                raise self.fault
            return self.kept.get(key) if name == "get" else self.kept.update({key: values[0]})

        return ask


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def cache(new) -> SteadyCache:
    return new()


@pytest.fixture
def new(server, request, monkeypatch):
    """Make the cache of one more thread."""
    monkeypatch.setattr(steady, "AWAY_S", 0.0)

    def make() -> SteadyCache:
        made = SteadyCache(f"redis://nobody/{request.node.name}", {})
        made._server = server
        return made

    return make


@pytest.mark.parametrize("fault", [NobodyThere("refused"), ResponseError("OOM"), OSError("gone")])
def test_without_its_server_the_cache_works_in_memory(cache, server, fault, caplog) -> None:
    server.fault = fault
    cache.set("a", 1)
    assert (cache.get("a"), cache.incr("a"), cache.add("a", 9), cache.get_or_set("b", 7)) == (1, 2, False, 7)
    assert not cache.answers()
    assert [record.levelno for record in caplog.records] == [logging.ERROR]


def test_entries_kept_in_memory_are_dropped_once_it_returns(cache, server, caplog) -> None:
    server.fault = NobodyThere("refused")
    cache.set("a", 1)
    server.fault = None
    assert cache.get("a") is None
    server.fault = NobodyThere("again")
    assert cache.get("a") is None
    assert [record.levelname for record in caplog.records] == ["ERROR", "WARNING", "ERROR"]


def test_a_hanging_server_is_tried_rarely_across_all_threads(new, server, monkeypatch) -> None:
    monkeypatch.setattr(steady, "AWAY_S", 60.0)
    server.fault = NobodyThere("timeout")
    for _ in range(9):
        new().set("a", 1)
    assert (new().get("a"), server.asked) == (1, 1)
