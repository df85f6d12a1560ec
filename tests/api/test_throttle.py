"""How often one racer may write."""

from __future__ import annotations

import io
import zlib

import numpy as np
import pytest
from rest_framework.test import APIClient
from rest_framework.throttling import ScopedRateThrottle

from tests.hostile.parts import network, pair

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def three_an_hour(monkeypatch):
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", {"upload": "3/hour", "write": "3/hour"})


def test_only_writing_is_limited_per_racer(alice, bob, as_racer):
    hers, his = as_racer(alice), as_racer(bob)
    answers = [hers.post("/api/v1/races/", {}) for _ in range(4)]
    assert [answer.status_code for answer in answers] == [400, 400, 400, 429]
    assert answers[-1].data["code"] == "throttled"
    assert 0 < answers[-1].data["params"]["wait_s"] <= 3600
    assert hers.get("/api/v1/races/").status_code == 200
    assert his.post("/api/v1/races/", {}).status_code == 400


def test_a_second_token_gives_no_second_allowance(alice, as_racer):
    for _ in range(3):
        as_racer(alice).post("/api/v1/races/", {})
    assert as_racer(alice).post("/api/v1/races/", {}).status_code == 429


def test_a_request_without_a_log_in_is_refused_and_not_counted(db):
    answers = [APIClient().post("/api/v1/races/", {}) for _ in range(5)]
    assert {answer.status_code for answer in answers} == {401}


def named_network(name: str) -> bytes:
    """Another network for every name."""
    return network(weights={"bias": np.full(5, zlib.crc32(name.encode()) % 1000, np.float32)}).SerializeToString()


def test_refused_uploads_have_their_own_allowance(alice, as_racer, monkeypatch):
    rates = {"upload": "2/hour", "refused_upload": "4/hour", "write": "3/hour"}
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", rates)
    client = as_racer(alice)

    def send(**files):
        return client.post("/api/v1/models/", files, format="multipart").status_code

    assert [send(package=io.BytesIO(b"no model at all")) for _ in range(3)] == [400] * 3, "one more than good ones"
    for name in ("a", "b"):
        (_, network), (_, metadata) = pair(named_network(name))
        assert send(model=io.BytesIO(network), metadata=io.BytesIO(metadata)) == 201
    (_, network), (_, metadata) = pair(named_network("c"))
    assert send(model=io.BytesIO(network), metadata=io.BytesIO(metadata)) == 429, "good ones count as before"


def test_refused_uploads_are_limited_too(alice, as_racer, monkeypatch):
    rates = {"upload": "9/hour", "refused_upload": "2/hour", "write": "9/hour"}
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", rates)
    sent = [
        as_racer(alice).post("/api/v1/models/", {"package": io.BytesIO(b"x")}, format="multipart") for _ in range(3)
    ]
    assert [answer.status_code for answer in sent] == [400, 400, 429]
