"""What a killed worker may leave in the moment in which bubblewrap starts is ended by the next one."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from evaluation.sandbox.enter import COMMAND as OURS
from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import POLICY
from evaluation.sandbox.start import end_orphans as end_orphans_once

from .conftest import PAYLOADS

end_orphans = end_orphans_once.__wrapped__

COMMAND = f"of the test of orphans in process {os.getpid()}"
WAITS = "import signal; signal.pause()"
LEADER = """
import subprocess, sys
quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
print(subprocess.Popen([sys.executable, "-c", sys.argv[1], sys.argv[2]], **quiet).pid)
"""


@pytest.fixture
def orphan() -> Iterator[int]:
    """A process that waits for ever, whose session leader is gone, as bubblewrap's first process would."""
    leader = [sys.executable, "-c", LEADER, WAITS, COMMAND]
    pid = int(subprocess.run(leader, start_new_session=True, stdout=subprocess.PIPE, check=True).stdout)
    pidfd = os.pidfd_open(pid)
    yield pid
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
    assert is_over(pidfd)  # else the next test might find it
    os.close(pidfd)


def is_over(pidfd: int) -> bool:
    """Whether the process has ended, given some seconds to."""
    return bool(select.select([pidfd], [], [], 10.0)[0])


def test_a_process_that_lost_its_bubblewrap_is_ended(orphan):
    pidfd = os.pidfd_open(orphan)
    try:
        assert end_orphans(COMMAND) == [orphan]
        assert is_over(pidfd)
    finally:
        os.close(pidfd)


def test_processes_of_others_are_left_alone(orphan):
    assert end_orphans("another command") == []
    os.kill(orphan, 0)


def test_a_process_with_a_living_leader_goes_on():
    leader = subprocess.Popen([sys.executable, "-c", WAITS, COMMAND], start_new_session=True)
    try:
        assert end_orphans(COMMAND) == []
        assert leader.poll() is None
    finally:
        leader.kill()
        leader.wait()


def test_running_sandboxed_processes_are_not_orphans(level):
    with launch("resources", limits=POLICY, arguments=["echo"], python_path=[PAYLOADS], level=level) as process:
        assert not {process.pid, process.inner_pid} & set(end_orphans(OURS))
        write_message(process.stdin, {"a": 1}, [], process.deadline)
        assert read_message(process.stdout, process.deadline) == ({"a": 1}, [])
