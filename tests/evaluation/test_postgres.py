"""The same queue on PostgreSQL and Redis: the same tests, run again there."""

from __future__ import annotations

import pytest

from tests.evaluation import test_processes as processes

NAMES = ("states", "queue", "turns", "rivals", "work", "garage", "storm")
FILES = [f"tests/evaluation/test_{name}.py" for name in NAMES]
CUT_OFF = (  # in the middle of a transaction; a stop, a sandbox or a whole worker's end is the same with every database
    processes.test_a_killed_pool_process_costs_one_attempt_and_no_result,
    processes.test_a_killed_pool_process_is_replaced_with_redis_too,
)


@pytest.mark.soak
@pytest.mark.postgres
@pytest.mark.redis
@pytest.mark.xdist_group("workers")
def test_the_queues_tests_pass_on_postgresql_too(again_on_postgresql):
    cut_off = (f"tests/evaluation/test_processes.py::{test.__name__}" for test in CUT_OFF)
    again_on_postgresql(*FILES, *cut_off, "-m", "not postgres")  # the storm, too
