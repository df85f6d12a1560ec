"""Memory in which a model is shown what its car sees: it answers the same, and can change nothing."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from evaluation.sandbox import observation_memory as shown_module
from evaluation.sandbox import policy as policy_module
from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import POLICY
from evaluation.sandbox.observation_memory import (
    SIZE,
    ObservationMemory,
    create_observation_memory,
    fits,
    map_for_reading,
    map_for_writing,
)
from evaluation.sandbox.policy import PolicyProcess
from evaluation.sandbox.policy_client import PolicyClient
from paddock.errors import PlatformFault
from paddock.network.policy_wire import FAST, REPLY, STEP

from .conftest import PAYLOADS
from .networks import CAMERA, HEADER, small_network

pytestmark = pytest.mark.usefixtures("nothing_left")
TOO_LARGE = {"inputs": [{"name": "a", "dtype": "uint8", "shape": [SIZE + 1]}], "outputs": 1, "ranges": None}


def picture(seed):
    return {CAMERA: np.random.default_rng(seed).integers(0, 256, (120, 160, 1), dtype=np.uint8)}


def answers(level):
    with PolicyProcess(level=level) as policy:
        policy.load(small_network(), HEADER)
        client = policy.client(HEADER)
        return policy.memory_fd, [client(picture(seed)).tobytes() for seed in range(5)]


@pytest.mark.any_level
def test_a_model_answers_the_same_by_memory_and_by_pipe(level, monkeypatch):
    memory_fd, by_memory = answers(level)
    assert memory_fd >= 0
    monkeypatch.setattr(policy_module, "create_observation_memory", lambda: None)
    no_fd, by_pipe = answers(level)
    assert no_fd == -1
    assert by_memory == by_pipe
    assert len(set(by_pipe)) == 5


@pytest.mark.any_level
def test_a_model_can_read_what_it_is_shown_and_change_nothing(level):
    shown = ObservationMemory()
    view = map_for_writing(shown.fd)
    view[:8] = b"a frame."
    fd = shown.reading_fd
    with launch(
        "shown_attacks", limits=POLICY, level=level, arguments=[str(fd)], pass_fds=[fd], python_path=[PAYLOADS]
    ) as process:
        shown.close_reading_end()
        deadline = time.monotonic() + 20
        said, _ = read_message(process.stdout, deadline)
        assert said["tried"] == 13
        assert said["through"] == []
        assert said["sees"] == "a frame."
        view[:8] = b"another."
        write_message(process.stdin, {}, deadline=deadline)
        later, _ = read_message(process.stdout, deadline)
    assert later["sees"] == "another."
    assert bytes(view[:8]) == b"another." and not any(view[8:])
    assert os.fstat(shown.fd).st_size == SIZE
    shown.close()
    shown.close()


def test_the_descriptor_for_reading_writes_nothing_outside_either():
    shown = ObservationMemory()
    try:
        view = map_for_reading(shown.reading_fd)
        with pytest.raises(OSError):
            os.write(shown.reading_fd, b"x")
        with pytest.raises(OSError):
            map_for_writing(shown.reading_fd)
        with pytest.raises(OSError):
            os.ftruncate(shown.fd, 0)  # sealed, for the referee too
        assert bytes(view[:4]) == bytes(4)
    finally:
        shown.close()


def test_a_host_without_such_memory_has_pipes(monkeypatch):
    def refuse(*_):
        raise OSError("no such call")

    monkeypatch.setattr(shown_module.os, "open", refuse)
    assert create_observation_memory() is None  # and no descriptor is left
    monkeypatch.undo()
    monkeypatch.delattr(shown_module.os, "memfd_create")
    assert create_observation_memory() is None
    assert map_for_writing(-1) is None and map_for_reading(-1) is None


def test_a_process_that_cannot_be_started_is_our_fault_and_leaves_no_memory(monkeypatch):
    def refuse(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr(policy_module, "launch", refuse)
    before = sorted(os.listdir("/proc/self/fd"))
    with pytest.raises(PlatformFault) as fault:
        PolicyProcess()
    assert fault.value.code == "sandbox_failed"
    assert sorted(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(("header", "shows"), [(HEADER, True), (TOO_LARGE, False)])
def test_what_has_no_room_goes_through_the_pipe(header, shows):
    assert fits(header) is shows
    shown, (read, write), (back, answer) = ObservationMemory(), os.pipe(), os.pipe()
    try:
        memory = map_for_writing(shown.fd)
        client = PolicyClient(back, write, header, memory=memory)
        (one,) = header["inputs"]
        observation = {one["name"]: np.full(one["shape"], 7, np.uint8)}
        os.write(answer, REPLY.pack(1, FAST) + np.ones(header["outputs"], np.float32).tobytes())
        shown_module.os.set_blocking(read, False)
        if shows:
            client(observation)
            assert os.read(read, 100) == STEP.pack(1)
        else:
            policy_module.widen_pipe(write)
            client(observation)
            assert os.read(read, SIZE) == STEP.pack(1) + bytes([7]) * (SIZE - STEP.size)
        assert set(memory[: observation[one["name"]].size if shows else SIZE]) == ({7} if shows else {0})
    finally:
        shown.close()
        for fd in (read, write, back, answer):
            os.close(fd)
