"""Processes of the web server take new connections in turns."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from config.serving.web import LONGEST_TURN_S, TURN_S, AcceptTurn


class Process:
    """A process with so many connections, and a clock that the test moves."""

    def __init__(self, connections: int) -> None:
        self.now, self.taken = 0.0, 0
        self.server = SimpleNamespace(
            active_channels=dict.fromkeys(range(connections)), accepting=True, handle_accept=self._take
        )
        self.turn = AcceptTurn(self.server, lambda: self.now)

    def _take(self) -> None:
        self.taken += 1

    def sees_a_connection(self) -> float:
        """How long it waits before it takes what it sees."""
        if self.server.accepting:
            self.server.handle_accept()
        return self.turn.wait_s()


def test_a_process_without_connections_takes_one_at_once() -> None:
    process = Process(0)
    assert process.sees_a_connection() == 1.0 and process.taken == 1 and process.server.accepting


def test_a_process_with_more_connections_waits_longer() -> None:
    few, many = Process(5), Process(30)
    assert few.sees_a_connection() == pytest.approx(5 * TURN_S)
    assert many.sees_a_connection() == pytest.approx(30 * TURN_S)
    assert not few.server.accepting and few.taken == many.taken == 0
    few.now = many.now = 6 * TURN_S
    few.turn.wait_s(), many.turn.wait_s()
    assert few.server.accepting and not many.server.accepting
    few.sees_a_connection()
    assert few.taken == 1 and many.taken == 0


def test_no_process_waits_longer_than_two_milliseconds() -> None:
    process = Process(5_000)
    assert process.sees_a_connection() == pytest.approx(LONGEST_TURN_S) == pytest.approx(0.002)
    process.now = LONGEST_TURN_S
    process.turn.wait_s()
    process.sees_a_connection()
    assert process.taken == 1


def test_a_connection_that_another_process_took_is_forgotten() -> None:
    process = Process(10)
    process.sees_a_connection()
    process.now = 1.0
    process.turn.wait_s()
    assert process.sees_a_connection() == pytest.approx(10 * TURN_S) and process.taken == 0
