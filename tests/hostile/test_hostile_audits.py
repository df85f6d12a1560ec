"""An audit of a hostile reward function ends with the code that validation gives, and within the same bounds."""

from __future__ import annotations

import time

import pytest

from evaluation.sandbox.limits import REWARD
from tests.soak import one_of_each
from tests.training.audit.driven import driven_on_the_oval
from training.rewards.audit.report import audit_reward

from .test_hostile import children, descriptors, is_left
from .test_hostile_rewards import marked_lines, parameters, source, takes_seconds


@pytest.fixture(scope="module")
def drives():
    return driven_on_the_oval()


def of_each_code() -> list:
    """The sandbox is that of validation, which meets them all; some are slow."""
    return one_of_each(parameters(), kind=lambda one: (one.values[0].split("/")[0], takes_seconds(one.values[0])))


@pytest.mark.parametrize("case", of_each_code())
def test_a_hostile_function_ends_an_audit_with_its_code_and_line(case, drives, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = source(case)
    before, began = (descriptors(), children()), time.monotonic()
    audit = audit_reward(text, drives)
    assert {failure.problem.code for failure in audit.failures} == {case.split("/")[0]}
    assert {failure.problem.line for failure in audit.failures} <= marked_lines(text)
    assert not is_left(before), "something was left open or running"
    assert list(tmp_path.iterdir()) == [], "something was written"
    assert time.monotonic() - began < REWARD.wall_s + 5.0
