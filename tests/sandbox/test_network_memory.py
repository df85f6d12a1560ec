"""Memory in which a model's process finds its network: it answers the same, and nobody can change it."""

from __future__ import annotations

import errno
import mmap
import os
import time

import numpy as np
import pytest

from evaluation.sandbox import network_memory as given_module
from evaluation.sandbox import policy as policy_module
from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import POLICY
from evaluation.sandbox.network_memory import READY, NetworkMemory, create_network_memory, map_network
from evaluation.sandbox.observation_memory import SIZE
from evaluation.sandbox.policy import PolicyProcess

from .conftest import PAYLOADS
from .networks import CAMERA, HEADER, small_network

pytestmark = pytest.mark.usefixtures("nothing_left")
NETWORK = bytes(range(256)) * (SIZE // 256 + 1)


@pytest.fixture
def given():
    memory = NetworkMemory()
    yield memory
    memory.close()


def answers(level, ready=False):
    """What a model says, and whether its network went through the pipe."""
    picture = np.random.default_rng(1).integers(0, 256, (120, 160, 1), dtype=np.uint8)
    with PolicyProcess(level=level) as policy:
        if ready:
            policy.get_ready()
        policy.load(small_network(), HEADER)
        return policy.client(HEADER)({CAMERA: picture}).tobytes()


@pytest.mark.any_level
def test_a_model_answers_the_same_by_memory_and_by_pipe(level, monkeypatch):
    written = []
    put = NetworkMemory.put
    monkeypatch.setattr(NetworkMemory, "put", lambda self, network: written.append(put(self, network)) or written[-1])
    by_memory = answers(level)
    assert answers(level, ready=True) == by_memory
    assert written == [True, True]
    monkeypatch.setattr(NetworkMemory, "put", lambda self, network: False)  # there is no memory left
    assert answers(level) == by_memory
    monkeypatch.setattr(policy_module, "create_network_memory", lambda: None)
    assert answers(level, ready=True) == by_memory


@pytest.mark.any_level
def test_a_model_can_read_its_network_and_change_nothing(level, given):
    fd = given.reading_fd
    with launch(
        "given_attacks", limits=POLICY, level=level, arguments=[str(fd)], pass_fds=[fd], python_path=[PAYLOADS]
    ) as process:
        given.close_reading_end()
        assert given.put(NETWORK)
        deadline = time.monotonic() + 20
        write_message(process.stdin, {"size": len(NETWORK)}, deadline=deadline)
        said, _ = read_message(process.stdout, deadline)
    assert said == {"tried": 13, "through": [], "sum": sum(NETWORK)}
    assert os.pread(given.fd, len(NETWORK) + 1, 0) == NETWORK


@pytest.mark.parametrize("ready", [False, True])
def test_nobody_changes_a_network_that_was_given(given, ready):
    if ready:
        given.get_ready()
        assert os.fstat(given.fd).st_blocks * 512 >= READY
    assert given.put(NETWORK)
    for attempt in (
        lambda: os.pwrite(given.fd, b"x", 0),
        lambda: os.ftruncate(given.fd, 0),
        lambda: mmap.mmap(given.fd, SIZE, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE),
        lambda: os.posix_fallocate(given.fd, 0, 2 * READY),
    ):
        with pytest.raises(OSError):
            attempt()
    assert not given.put(b"another")
    assert map_network(given.reading_fd, len(NETWORK)) == NETWORK


def test_what_cannot_be_written_goes_through_the_pipe(given):
    assert not given.put(b"")
    given.close()
    given.close()
    assert not given.put(NETWORK)
    given.get_ready()  # for nothing


def test_a_host_without_such_memory_has_pipes(monkeypatch):
    monkeypatch.delattr(given_module.os, "memfd_create")
    assert create_network_memory() is None


def test_a_network_without_room_is_out_of_memory(monkeypatch):
    def refuse(code):
        def map_memory(*_args, **_options):
            raise OSError(code, "mmap")

        monkeypatch.setattr(given_module, "map_memory", map_memory)

    refuse(errno.ENOMEM)
    with pytest.raises(MemoryError):
        map_network(3, 100)
    refuse(errno.EACCES)
    with pytest.raises(OSError):
        map_network(3, 100)
