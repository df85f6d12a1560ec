"""A question and its answer in C: the same as by Python alone, whatever the other end does."""

from __future__ import annotations

import array
import fcntl
import os
import termios
import threading
import time

import numpy as np
import pytest

from evaluation.sandbox.observation_memory import ObservationMemory, map_for_reading, map_for_writing
from evaluation.sandbox.policy_client import PolicyClient
from paddock.errors import UserFault
from paddock.network.policy_wire import CHECKED, EXACT, FAST, REPLY, STEP

from .networks import CAMERA, HEADER


class ByPython(PolicyClient):
    library = None


pytestmark = [
    pytest.mark.skipif(PolicyClient.library is None, reason="no compiled library"),
    pytest.mark.usefixtures("nothing_left"),
]
GREY = {CAMERA: np.full((120, 160, 1), 100, np.uint8)}
PATIENT = {"step_deadline_s": 60.0, "overage_s": 0.0, "total_s": 60.0}
IMPATIENT = {"step_deadline_s": 0.0, "overage_s": 0.0, "total_s": 60.0}


def reply(step, values=(0.25, -1.5, 3.0), way=FAST):
    return REPLY.pack(step, way) + np.array(values, "<f4").tobytes()


class Ends:
    """A client, and the other ends of its pipes."""

    def __init__(self, client, budget=PATIENT, outputs=3):
        self.shown = ObservationMemory()
        self.requests, write = os.pipe()
        read, self.answers = os.pipe()
        self._fds = [self.requests, write, read, self.answers]
        header = {**HEADER, "outputs": outputs}
        self.client = client(read, write, header, memory=map_for_writing(self.shown.fd), **budget)
        self.write_fd = write

    def waiting_bytes(self):
        """What of the answers nobody has read yet."""
        count = array.array("i", [0])
        fcntl.ioctl(self.answers, termios.FIONREAD, count)
        return count[0]

    def close_end(self, fd):
        self._fds.remove(fd)
        os.close(fd)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.shown.close()
        for fd in self._fds:
            os.close(fd)


@pytest.fixture(params=[PolicyClient, ByPython])
def client(request):
    return request.param


def fault_of(client):
    with pytest.raises(UserFault) as caught:
        client.ask(GREY)
    return caught.value.code, {name: value for name, value in caught.value.params.items() if name != "waited_s"}


def test_the_library_here_has_the_exchange():
    with Ends(PolicyClient) as ends:
        assert ends.client._call is not None
    with Ends(ByPython) as ends:
        assert ends.client._call is None


def test_answers_are_numbers_and_counted_by_their_way(client):
    with Ends(client) as ends:
        seen = map_for_reading(ends.shown.reading_fd)
        for step, way in enumerate([FAST, EXACT, CHECKED, FAST], 1):
            os.write(ends.answers, reply(step, (step / 4, -0.0, 3.4e38), way))
            answer = ends.client.ask({CAMERA: GREY[CAMERA] + np.uint8(step)})
            assert answer == [step / 4, -0.0, float(np.float32(3.4e38))]
            assert type(answer) is list and all(type(value) is float for value in answer)
            assert os.read(ends.requests, 100) == STEP.pack(step)
            assert set(seen[:19200]) == {100 + step}
        assert list(ends.client.counts.values()) == [2, 1, 1, 0]
        assert ends.client.step == 4
        assert 0 < ends.client.seconds < 60


@pytest.mark.parametrize(
    ("values", "best"),
    [
        ((0.25, -1.5, 3.0), 2),
        ((-3.0, -1.5, -2.0), 1),
        ((1.0, 1.0, 1.0), 0),
        ((0.0, 2.5, 2.5), 1),
        ((-0.0, 0.0, -1.0), 0),
        ((-3.4e38, -3.4e38, -3.3e38), 2),
        ((1e-45, 0.0, 3e-45), 2),
        ((-1e-45, -3e-45, -2e-38), 0),
    ],
)
def test_the_first_of_the_greatest_is_chosen(client, values, best):
    with Ends(client) as ends:
        os.write(ends.answers, reply(1, values))
        assert ends.client.choose(GREY) == best
        os.write(ends.answers, reply(2, values))
        answer = ends.client.ask(GREY)
        assert answer.index(max(answer)) == best
        for step, odd in enumerate((float("nan"), float("inf")), 3):
            os.write(ends.answers, reply(step, (0.0, odd, 1.0)))
            with pytest.raises(UserFault) as caught:
                ends.client.choose(GREY)
            assert caught.value.code == "non_finite_action"


def test_whoever_filled_the_places_asks_with_them(client):
    with Ends(client) as ends:
        ends.client.places[CAMERA][...] = 7
        os.write(ends.answers, reply(1))
        assert ends.client.ask(ends.client.places) == [0.25, -1.5, 3.0]
        assert set(map_for_reading(ends.shown.reading_fd)[:19200]) == {7}


@pytest.mark.parametrize(
    ("said", "code"),
    [
        (reply(2), "policy_protocol"),
        (reply(0), "policy_protocol"),
        (reply(1, way=4), "policy_protocol"),
        (reply(1, way=2**32 - 1), "policy_protocol"),
        (reply(1) + b"\0", "policy_protocol"),
        (reply(1) + reply(1), "policy_protocol"),
        (reply(1, (0.0, float("nan"), 1.0)), "non_finite_action"),
        (reply(1, (0.0, 0.0, float("inf"))), "non_finite_action"),
        (reply(1, (float("-inf"), 0.0, 0.0)), "non_finite_action"),
        (REPLY.pack(1, FAST) + bytes.fromhex("0100807f") * 3, "non_finite_action"),  # a signalling one
    ],
)
def test_anything_but_one_reply_to_this_step_is_a_fault(client, said, code):
    with Ends(client) as ends:
        os.write(ends.answers, said)
        assert fault_of(ends.client) == (code, {"step": 1})


@pytest.mark.parametrize("cut", [0, 1, 7, 8, 19])
def test_a_reply_that_comes_in_pieces_is_put_together(client, cut):
    with Ends(client) as ends:
        whole = reply(1)

        def answer():
            assert os.read(ends.requests, 100) == STEP.pack(1)
            os.write(ends.answers, whole[:cut])
            while ends.waiting_bytes():
                time.sleep(0.001)
            os.write(ends.answers, whole[cut:])

        other = threading.Thread(target=answer)
        other.start()
        assert ends.client.ask(GREY) == [0.25, -1.5, 3.0]
        other.join()


@pytest.mark.parametrize("end", ["answers", "requests"])
def test_closed_pipes_are_a_death(client, end):
    with Ends(client) as ends:
        if end == "requests":
            ends.close_end(ends.requests)
        ends.close_end(ends.answers)
        assert fault_of(ends.client) == ("policy_died", {"step": 1, "how": "closed its pipes"})


def test_a_half_reply_and_a_closed_pipe_are_a_death(client):
    with Ends(client) as ends:
        os.write(ends.answers, reply(1)[:9])
        ends.close_end(ends.answers)
        assert fault_of(ends.client)[0] == "policy_died"


def test_nobody_waits_beyond_the_deadline(client):
    with Ends(client, IMPATIENT) as ends:
        code, params = fault_of(ends.client)
        assert code == "policy_late"
        assert params == {"step": 1, "exact": 0, "step_s": 0.0, "overage_s": 0.0, "total_s": 60.0}


def test_a_reply_that_is_there_is_taken_however_late_it_is(client):
    with Ends(client, IMPATIENT) as ends:
        os.write(ends.answers, reply(1))
        assert ends.client.ask(GREY) == [0.25, -1.5, 3.0]
        assert ends.client._account.bank_s < 0.0
        assert fault_of(ends.client)[0] == "policy_late"


def test_what_is_above_the_deadline_comes_from_the_bank(client):
    with Ends(client, {"step_deadline_s": 0.0, "overage_s": 60.0, "total_s": 60.0}) as ends:
        for step in (1, 2):
            os.write(ends.answers, reply(step))
            ends.client.ask(GREY)
        assert ends.client._account.bank_s == pytest.approx(60.0 - ends.client.seconds, abs=1e-9)
        ends.client._account.bank_s = -1.0
        assert fault_of(ends.client)[0] == "policy_late"


def test_all_steps_together_have_a_limit(client):
    with Ends(client, {"step_deadline_s": 60.0, "overage_s": 0.0, "total_s": 0.0}) as ends:
        assert fault_of(ends.client)[0] == "policy_late"


def test_mostly_exact_answers_are_named_where_one_is_late(client):
    with Ends(client, IMPATIENT) as ends:
        for step in (1, 2):
            os.write(ends.answers, reply(step, way=EXACT))
            ends.client._account.bank_s = 0.0
            ends.client.ask(GREY)
        assert fault_of(ends.client)[0] == "policy_late_exact"


def test_a_full_pipe_is_waited_for(client):
    with Ends(client) as ends:
        filled = 0
        while True:
            try:
                filled += os.write(ends.write_fd, bytes(4096))
            except BlockingIOError:
                break

        def answer():
            left = filled
            while left:
                left -= len(os.read(ends.requests, left))
            assert os.read(ends.requests, 100) == STEP.pack(1)
            os.write(ends.answers, reply(1))

        other = threading.Thread(target=answer)
        other.start()
        assert ends.client.ask(GREY) == [0.25, -1.5, 3.0]
        other.join()


def test_a_full_pipe_that_nobody_reads_is_late(client):
    with Ends(client, IMPATIENT) as ends:
        with pytest.raises(BlockingIOError):
            while True:
                os.write(ends.write_fd, bytes(4096))
        assert fault_of(ends.client)[0] == "policy_late"


def test_a_disagreement_about_sensors_asks_nobody(client):
    with Ends(client) as ends:
        for wrong in ({}, {CAMERA: GREY[CAMERA].astype(np.float32)}, {CAMERA: GREY[CAMERA][:, :, 0]}):
            with pytest.raises(ValueError):
                ends.client.ask(wrong)
        os.set_blocking(ends.requests, False)
        with pytest.raises(BlockingIOError):
            os.read(ends.requests, 1)
        assert ends.client.step == 0
