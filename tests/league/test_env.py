"""Numbers in the environment: nonsense is refused with the variable's name."""

from __future__ import annotations

import pytest
from django.core.exceptions import ImproperlyConfigured

from league.env import env_int


@pytest.mark.parametrize(("value", "problem"), [("1", "at least 2"), ("33", "at most 32"), ("many", "whole number")])
def test_a_number_out_of_range_is_refused(monkeypatch, value, problem):
    monkeypatch.setenv("PADDOCK_DUELS_IN_ROUND_ROBIN", value)
    with pytest.raises(ImproperlyConfigured, match=f"PADDOCK_DUELS_IN_ROUND_ROBIN must be .*{problem}"):
        env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32)


def test_a_number_in_range_is_taken_and_none_is_the_default(monkeypatch):
    monkeypatch.setenv("PADDOCK_DUELS_IN_ROUND_ROBIN", "32")
    assert env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32) == 32
    monkeypatch.delenv("PADDOCK_DUELS_IN_ROUND_ROBIN")
    assert env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32) == 16
