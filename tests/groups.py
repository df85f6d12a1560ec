"""Tests of one group run in one process, one after the other, when pytest-xdist deals them out.

pytest-xdist 3.8 writes the group behind a test's name, where pytest 9.2 does not read it: every test would go to
whoever is free. So a process that has collected writes down which test is in which group, for the process that deals.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

MARK = "xdist_group"


def write_down(items: Iterable[pytest.Item]) -> None:
    """Note the groups of what was collected; whoever looks sees all of them or none."""
    groups = {item.nodeid: mark.args[0] for item in items if (mark := item.get_closest_marker(MARK)) is not None}
    mine = _noted().with_name(f"groups-{os.getpid()}")
    mine.write_text(json.dumps(groups))
    mine.replace(_noted())


class GroupScheduling(LoadScopeScheduling):
    """Deals out groups in the order of their first tests; a test without one is its own."""

    @cached_property
    def _groups(self) -> dict[str, str]:
        return json.loads(_noted().read_text())

    def _split_scope(self, nodeid: str) -> str:
        return self._groups.get(nodeid, nodeid)


def _noted() -> Path:
    return Path(os.environ["PADDOCK_TEST_DATA"]) / "groups.json"
