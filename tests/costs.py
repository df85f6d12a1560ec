"""What the tests cost, in seconds of a processor: by folder, and those that cost much and are not marked so.

Printed at the end of a large run, never asserted: so that who adds tests sees what became of the minutes. A test's
seconds are those of its process and of the processes that it started and waited for, fixtures made for it included.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

LARGE = 500  # tests; below, nobody asks
MUCH_S = 1.0
SHOWN = 20
KEY = "processor_s"
SLOW = ("slow", "soak")


def spent_s() -> float:
    """The seconds so far of this process and of the children that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def folder_of(nodeid: str) -> str:
    """``tests/paddock/simulator`` for a test of the engine, ``tests/races`` for one of a room."""
    parts = nodeid.partition("::")[0].split("/")[:-1]
    return "/".join(parts[: 3 if parts[1:2] == ["paddock"] else 2])


@dataclass
class Costs:
    """Of a whole run, gathered from the reports of all its processes."""

    folders: Counter[str] = field(default_factory=Counter)
    tests: Counter[str] = field(default_factory=Counter)
    unmarked: list[tuple[float, str]] = field(default_factory=list)  # those that cost much and are not marked slow

    def add(self, nodeid: str, seconds: float, is_slow: bool) -> None:
        self.folders[folder_of(nodeid)] += seconds
        self.tests[folder_of(nodeid)] += 1
        if seconds > MUCH_S and not is_slow:
            self.unmarked.append((seconds, nodeid))

    def lines(self) -> Iterator[str]:
        """What is printed of them."""
        for folder, seconds in self.folders.most_common():
            yield f"{seconds:7.1f} s  {self.tests[folder]:5d} tests  {folder}"
        yield f"{self.folders.total():7.1f} s  {self.tests.total():5d} tests"
        if not self.unmarked:
            return
        yield f"more than {MUCH_S:g} s, and not marked slow:"
        for seconds, nodeid in sorted(self.unmarked, reverse=True)[:SHOWN]:
            yield f"{seconds:7.1f} s  {nodeid}"
        if len(self.unmarked) > SHOWN:
            yield f"and {len(self.unmarked) - SHOWN} more"


class Watch:
    """The plugin: each process of a run measures, the one that prints gathers."""

    def __init__(self) -> None:
        self.costs = Costs()
        self._began = 0.0

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self) -> Iterator[None]:
        self._began = spent_s()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo) -> Iterator[None]:
        report = yield
        if call.when == "teardown":
            report.user_properties.append((KEY, round(spent_s() - self._began, 3)))
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for name, seconds in report.user_properties:
            if name == KEY and report.when == "teardown":
                self.costs.add(report.nodeid, seconds, any(mark in report.keywords for mark in SLOW))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.costs.tests.total() >= LARGE:
            terminalreporter.section("seconds of a processor")
            for line in self.costs.lines():
                terminalreporter.write_line(line)
