"""The figures of an audit: worth, rank correlation and order, against values that are computed by hand."""

from __future__ import annotations

import pytest

from training.rewards.audit.drives import RecordedDrive
from training.rewards.audit.report import audit_reward, correlation, worth_of
from training.rewards.audit.views import rank_chart


def a_drive(name, steps, *, lap_ms=None, ended="lap_complete", progress=100.0):
    """A drive of so many steps at the even pace that ends at ``progress``, with the params that a function needs."""
    states = tuple(
        {"steps": step, "progress": progress * step / steps, "speed": 1.0, "objects_location": [], "waypoints": []}
        for step in range(1, steps + 1)
    )
    return RecordedDrive(name, states, lap_ms, ended, steps / 15)


def test_worth_by_hand():
    # from the last step back: 1, 1 + 0.5 * 1 = 1.5, 1 + 0.5 * 1.5 = 1.75; their mean times 1 - 0.5
    assert worth_of([1.0, 1.0, 1.0], 0.5) == pytest.approx(0.5 * (1.0 + 1.5 + 1.75) / 3)
    assert worth_of([0.0, 0.0, 8.0], 0.5) == pytest.approx(0.5 * (8.0 + 4.0 + 2.0) / 3)
    assert worth_of([2.0, 4.0], 0.0) == pytest.approx(3.0)


def test_the_worth_of_a_long_constant_reward_is_that_reward():
    assert worth_of([3.0] * 5000, 0.97) == pytest.approx(3.0, rel=0.01)
    assert worth_of([3.0] * 10, 0.97) < 0.6


def test_without_discount_a_reward_still_has_a_worth():
    assert 0 < worth_of([1.0] * 10, 1.0) < worth_of([1.0] * 20, 1.0)


def test_rank_correlations_by_hand():
    assert correlation([1, 2, 3], [10, 20, 90]) == pytest.approx(1.0)
    assert correlation([1, 2, 3], [9, 2, 1]) == pytest.approx(-1.0)
    # differences of ranks 1, 1, 0, 0: 1 - 6 * 2 / (4 * 15)
    assert correlation([2, 1, 3, 4], [1, 2, 3, 4]) == pytest.approx(0.8)
    # two equal values share the rank 1.5: the differences are 0.5, 0.5, 0
    assert correlation([5, 5, 7], [1, 2, 3]) == pytest.approx(0.8660254)


def test_equal_values_and_two_drives_have_no_correlation():
    assert correlation([1, 1, 1], [1, 2, 3]) is None
    assert correlation([0.1 + 0.2, 0.3, 0.3], [1, 2, 3]) is None  # equal but for rounding
    assert correlation([1, 2], [1, 2]) is None


def test_ranks_and_order_of_drives_by_hand():
    drives = [
        a_drive("fast", 40, lap_ms=2600),
        a_drive("slow", 80, lap_ms=5300),
        a_drive("crash", 20, ended="off_track", progress=30.0),
        a_drive("standing", 90, ended="time_up", progress=10.0),
    ]
    audit = audit_reward("def reward_function(params):\n    return 1.0\n", drives, discount=0.9)
    by_name = {row.drive.name: row for row in audit.rows}
    assert {name: row.by_time for name, row in by_name.items()} == {"fast": 1, "slow": 2, "crash": 3, "standing": 4}
    assert {name: row.by_reward for name, row in by_name.items()} == {"fast": 3, "slow": 2, "crash": 4, "standing": 1}
    assert {name: row.total for name, row in by_name.items()} == {"fast": 40, "slow": 80, "crash": 20, "standing": 90}
    # pairs in both orders: fast-crash and slow-crash; slow and standing differ by less than 2 %
    (order,) = [one.fault.params for one in audit.findings if one.fault.code == "reward_order"]
    assert order == {"same": 2, "all": 6}


def test_each_drive_begins_with_a_function_that_is_loaded_again():
    counts = "calls = 0\n\n\ndef reward_function(params):\n    global calls\n    calls += 1\n    return float(calls)\n"
    drives = [a_drive("fast", 4, lap_ms=300), a_drive("slow", 6, lap_ms=400)]
    assert [row.rewards for row in audit_reward(counts, drives).rows] == [(1, 2, 3, 4), (1, 2, 3, 4, 5, 6)]


def test_what_it_prints_is_kept_of_the_first_drive_alone():
    prints = "def reward_function(params):\n    print(params['steps'])\n    return 1.0\n"
    drives = [a_drive("fast", 2, lap_ms=300), a_drive("slow", 3, lap_ms=400)]
    assert audit_reward(prints, drives).printed == "1\n2\n"


def test_the_chart_has_a_level_line_for_equal_ranks_and_escapes_names():
    svg = rank_chart([("<a>", 1, 1), ("b", 2, 3), ("c", 3, 2)], title="Ranks", by_time="By time", by_reward="By reward")
    assert svg.count('class="audit-drive level"') == svg.count('class="audit-drive up"') == 1
    assert "<a>" not in svg
    assert 'aria-label="Ranks"' in svg
