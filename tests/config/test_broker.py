"""The bundled server's socket: found by every client whatever the data folder is called."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from celery import Celery
from django.core.cache.backends.redis import RedisCache

from config.serving import broker
from tests import servers


def test_the_socket_is_in_the_data_folder_if_its_path_fits():
    assert broker.socket_path(Path("/data/valkey")) == Path("/data/valkey/valkey.sock")


@pytest.mark.parametrize("letter", ["x", "자"])
def test_a_path_too_long_for_a_socket_moves_it_to_tmp(letter):
    folders = [Path("/data") / (letter * length) for length in range(20, 200)]
    for folder in folders:
        path = broker.socket_path(folder)
        assert len(os.fsencode(path)) <= 107
        if path.parent != folder:
            assert len(os.fsencode(folder / "valkey.sock")) > 107
            assert path.parent.parent == Path("/tmp")
    assert len({broker.socket_path(folder) for folder in folders}) == len(folders)


@pytest.mark.parametrize("name", ["plain", "50% of #1?", "with spaces & 자동차", "100%25", "long " + "x" * 100])
def test_celery_and_the_cache_find_the_server(name):
    with servers.short_folder() as parent:
        folder = parent / name
        path = broker.socket_path(folder)
        for place in (folder, path.parent):
            broker.make_private(place)
        with servers.running(broker.server_command(folder, path), lambda: servers.answers(path)):
            with Celery(broker=broker.broker_url(path), set_as_current=False).connection_for_write() as connection:
                connection.ensure_connection(max_retries=1, timeout=2)
            cache = RedisCache(broker.cache_url(path), {})
            cache.set("speed", 4)
            assert cache.get("speed") == 4
            assert path.stat().st_mode & 0o077 == 0
        if path.parent != folder:
            path.parent.rmdir()


def test_a_folder_owned_by_somebody_else_is_not_used(tmp_path):
    target = tmp_path / "theirs"
    target.mkdir()
    link = tmp_path / "link"
    link.symlink_to(target)
    with pytest.raises(OSError):
        broker.make_private(link)
    if os.getuid() == 0:
        os.chown(target, 12345, 12345)
        with pytest.raises(PermissionError):
            broker.make_private(target)


def test_a_private_folder_is_closed_to_others(tmp_path):
    folder = tmp_path / "open"
    folder.mkdir(mode=0o755)
    broker.make_private(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
