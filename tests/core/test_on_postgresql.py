"""What happens at once ends on PostgreSQL as on SQLite: locks, leases and triggers, all rooms in one process.

The tables of states and leases, and whatever else a room asks of its database, ``make soak`` asks of PostgreSQL, too.
"""

from __future__ import annotations

import pytest

AT_ONCE = {
    "core/audit": ("recording",),
    "api": ("writes_at_once",),
    "core/jobs": ("holds",),
    "evaluation": ("queue",),
    "races": ("concurrency", "counting", "duels_concurrency", "live_concurrency"),
    "videos": ("concurrency",),
    "training": ("concurrency",),
    "league": ("simultaneous",),
}


@pytest.mark.slow
@pytest.mark.postgres
def test_concurrency_on_postgresql_ends_as_on_sqlite(again_on_postgresql):
    again_on_postgresql(*(f"tests/{room}/test_{name}.py" for room, names in AT_ONCE.items() for name in names))
