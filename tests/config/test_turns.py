"""Processes of the web server take new connections in turns."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from config.serving.web import LONGEST_TURN_S, TAKEN_AT_ONCE, TURN_S, take_turns


class Process:
    """A process with so many connections, and what it did when it saw new ones."""

    def __init__(self, connections: int, waiting: int) -> None:
        self.slept: list[float] = []
        self.waiting = waiting
        self.server = SimpleNamespace(active_channels=dict.fromkeys(range(connections)), handle_accept=self._accept)
        take_turns(self.server, self.slept.append)

    def _accept(self) -> None:
        if self.waiting:
            self.waiting -= 1
            self.server.active_channels[len(self.server.active_channels)] = None


def test_a_process_with_more_connections_waits_longer_before_it_takes_one() -> None:
    waits = []
    for connections in (0, 5, 30):
        process = Process(connections, waiting=1)
        process.server.handle_accept()
        waits += process.slept
        assert process.waiting == 0 and len(process.server.active_channels) == connections + 1
    assert waits == pytest.approx([0.0, 5 * TURN_S, 30 * TURN_S])


def test_no_process_waits_longer_than_two_milliseconds() -> None:
    process = Process(5_000, waiting=1)
    process.server.handle_accept()
    assert process.slept == [LONGEST_TURN_S] and LONGEST_TURN_S <= 0.002


def test_one_turn_takes_a_few_connections_and_leaves_the_rest_to_others() -> None:
    process = Process(10, waiting=50)
    process.server.handle_accept()
    assert process.waiting == 50 - TAKEN_AT_ONCE and len(process.slept) == 1


def test_a_connection_that_another_process_took_is_no_error() -> None:
    process = Process(10, waiting=0)
    process.server.handle_accept()
    assert len(process.server.active_channels) == 10
