"""What a run of the tests says that it cost (tests/costs.py)."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tests.costs import KEY, MUCH_S, SHOWN, Costs, Watch, folder_of, spent_s


@pytest.mark.parametrize(
    ("nodeid", "folder"),
    [
        ("tests/races/test_own.py::test_a[x::y/z]", "tests/races"),
        ("tests/races/engines/test_own.py::test_a", "tests/races"),
        ("tests/paddock/simulator/test_car.py::test_a", "tests/paddock/simulator"),
        ("tests/paddock/test_portable.py::test_a", "tests/paddock"),
    ],
)
def test_a_test_counts_for_the_folder_of_its_room(nodeid, folder):
    assert folder_of(nodeid) == folder


def test_folders_are_shown_by_their_seconds_with_a_total():
    costs = Costs()
    costs.add("tests/races/test_a.py::test_a", 0.25, False)
    costs.add("tests/tracks/test_b.py::test_b", 2.0, True)
    costs.add("tests/races/test_a.py::test_b", 0.25, False)
    assert [" ".join(line.split()) for line in costs.lines()] == [
        "2.0 s 1 tests tests/tracks",
        "0.5 s 2 tests tests/races",
        "2.5 s 3 tests",
    ]


def test_what_costs_much_and_is_not_marked_is_named():
    costs = Costs()
    for number in range(SHOWN + 2):
        costs.add(f"tests/races/test_a.py::test_{number}", MUCH_S + 1 + number, False)
    costs.add("tests/races/test_a.py::test_marked", 99.0, True)
    lines = list(costs.lines())
    assert lines[2] == "more than 1 s, and not marked slow:"
    assert lines[3].endswith(f"::test_{SHOWN + 1}") and lines[-1] == "and 2 more"
    assert not any("marked" in line for line in lines[3:])


def test_seconds_come_with_the_report_of_the_end(request):
    """Of this very test, as the process that prints will find them."""
    (watch,) = (plugin for plugin in request.config.pluginmanager.get_plugins() if isinstance(plugin, Watch))
    before = spent_s()
    while spent_s() - before < 0.02:
        pass
    report = SimpleNamespace(user_properties=[])
    hook = watch.pytest_runtest_makereport(SimpleNamespace(when="teardown"))
    next(hook)
    with pytest.raises(StopIteration) as ended:
        hook.send(report)
    assert ended.value.value is report
    ((name, seconds),) = report.user_properties
    assert name == KEY and seconds >= 0.02
