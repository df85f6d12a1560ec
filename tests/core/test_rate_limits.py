"""Limits on attempts: rates, counts taken back, and the client's address."""

import pytest
from django.core.cache import cache
from django.test import RequestFactory

from core import rate_limits
from core.rate_limits import address_of, count


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """A clock that stands still until it is set."""
    cache.clear()
    now = [1000.0]
    monkeypatch.setattr(rate_limits.time, "time", lambda: now[0])
    return now


def test_a_rate_counts_each_key_and_action_by_itself():
    assert [count("guess", "alice", "2/m") is not None for _ in range(3)] == [True, True, False]
    assert count("guess", "bob", "2/m") and count("other", "alice", "2/m")


def test_attempts_older_than_the_window_count_no_more(clock):
    assert count("guess", "alice", "2/5m")
    clock[0] += 200
    assert count("guess", "alice", "2/5m") and not count("guess", "alice", "2/5m")
    clock[0] += 101
    assert count("guess", "alice", "2/5m") and not count("guess", "alice", "2/5m")


def test_all_rates_hold_together(clock):
    rates = "1/s,2/d"
    assert count("guess", "alice", rates) and not count("guess", "alice", rates)
    clock[0] += 2
    assert count("guess", "alice", rates)
    clock[0] += 2
    assert not count("guess", "alice", rates)


def test_a_count_can_be_taken_back():
    first = count("guess", "alice", "1/m,1/h")
    assert first is not None and not count("guess", "alice", "1/m,1/h")
    first.rollback()
    assert count("guess", "alice", "1/m,1/h")


def test_a_lock_that_another_process_holds_refuses_the_attempt(monkeypatch):
    monkeypatch.setattr(rate_limits, "WAIT_S", 0.05)
    with rate_limits._locked("rate:key"), rate_limits._locked("rate:key") as locked:
        assert not locked
    with rate_limits._locked("rate:key") as locked:
        assert locked


@pytest.mark.parametrize(
    ("sent", "address"),
    [("192.0.2.7", "192.0.2.7"), ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::"), ("", "")],
)
def test_an_address_in_ipv6_is_its_network(sent, address):
    assert address_of(RequestFactory().get("/", REMOTE_ADDR=sent)) == address
