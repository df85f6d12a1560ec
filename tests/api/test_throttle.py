"""How often one racer may write."""

from __future__ import annotations

import pytest
from rest_framework.test import APIClient
from rest_framework.throttling import ScopedRateThrottle

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def three_an_hour(monkeypatch):
    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", {"upload": "3/hour", "write": "3/hour"})


def test_writing_is_limited_for_each_racer_and_reading_is_not(alice, bob, as_racer):
    hers, his = as_racer(alice), as_racer(bob)
    answers = [hers.post("/api/v1/races/", {}) for _ in range(4)]
    assert [answer.status_code for answer in answers] == [400, 400, 400, 429]
    assert answers[-1].data["code"] == "throttled"
    assert 0 < answers[-1].data["params"]["wait_s"] <= 3600
    assert hers.get("/api/v1/races/").status_code == 200
    assert his.post("/api/v1/races/", {}).status_code == 400


def test_another_token_is_no_second_budget(alice, as_racer):
    for _ in range(3):
        as_racer(alice).post("/api/v1/races/", {})
    assert as_racer(alice).post("/api/v1/races/", {}).status_code == 429


def test_who_is_not_logged_in_is_told_so_and_not_counted(db):
    answers = [APIClient().post("/api/v1/races/", {}) for _ in range(5)]
    assert {answer.status_code for answer in answers} == {401}
