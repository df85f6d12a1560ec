"""What the supervisor does with programs that die, fall ill or cannot live. The real site is in test_run."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic

import pytest

from config.serving.supervisor import GRACE_S
from tests.evaluation.processes import is_running, wait_for
from tests.shared import CHECKOUT

pytestmark = pytest.mark.slow

PROGRAM = """
import os, sys, time
name, folder, what = sys.argv[1:]
with open(f"{folder}/{name}", "a") as file:
    file.write(f"{os.getpid()}\\n")
first = len(open(f"{folder}/{name}").readlines()) == 1
if what == "dies" or what == "dies first" and first:
    sys.exit(3)
if what == "sick first" and first:
    print("Unrecoverable error: Could not start worker processes", flush=True)
if what == "drained":
    sys.exit(75)
if what == "parent":
    if os.fork() == 0:
        open(f"{folder}/child", "a").write(f"{os.getpid()}\\n")
while True:
    time.sleep(60)
"""
SUPERVISOR = """
import sys
from functools import partial
from config.serving import supervisor
from config.serving.forking import become
supervisor.LIVES_AFTER_S, supervisor.LONGEST_PAUSE_S, supervisor.DRAINED_PAUSE_S = 30.0, 0.1, 0.1
s = supervisor.Supervisor()
folder = sys.argv[1]
for name, what in (one.split("=") for one in sys.argv[2:]):
    command = [sys.executable, "-I", "-S", f"{folder}/program.py", name, folder, what]
    s.add(name, partial(become, command), needed_to_the_end=name == "broker", vital=name == "web")
culprit, status = s.run(beside=lambda: print("beside"))
print("culprit", culprit, status, flush=True)
"""


SHARING = """
import collections, signal, sys
from config.serving import supervisor
from functools import partial
from config.serving.forking import PYTHON, become
collections.loaded_here = "loaded by the supervisor"
held = open(sys.argv[1], "a")
s = supervisor.Supervisor()
s.add("web", partial(become, [*PYTHON, "tests.config.forked", sys.argv[1], "of its own"], 3), vital=True)
s.run(beside=lambda: None)
"""


class Running:
    def __init__(self, folder: Path, *programs: str) -> None:
        self.folder, self.log = folder, folder / "log"
        (folder / "program.py").write_text(PROGRAM)
        with self.log.open("wb") as output:
            command = [sys.executable, "-c", SUPERVISOR, str(folder), *programs]
            self.process = subprocess.Popen(command, cwd=CHECKOUT, stdout=output, stderr=subprocess.STDOUT)

    def pids(self, name: str) -> list[int]:
        """The processes that a program has been, in their order."""
        path = self.folder / name
        return [int(line) for line in path.read_text().splitlines()] if path.exists() else []

    def started(self, name: str, times: int = 1) -> int:
        wait_for(lambda: len(self.pids(name)) >= times, 10, self.log)
        return self.pids(name)[-1]

    @property
    def said(self) -> str:
        return self.log.read_text()


@pytest.fixture
def programs(tmp_path):
    running = []

    def run(*programs: str) -> Running:
        running.append(Running(tmp_path, *programs))
        return running[0]

    yield run
    for one in running:
        one.process.kill()
        one.process.wait()


def test_a_killed_program_is_restarted_alone(programs):
    run = programs("web=stays", "video-worker=parent", "broker=stays")
    web, broker, video_worker = (run.started(name) for name in ("web", "broker", "video-worker"))
    child = run.started("child")
    os.kill(video_worker, signal.SIGKILL)
    again = run.started("video-worker", 2)
    assert "video-worker ended by itself (signal 9). It is started again in" in run.said
    assert not is_running(child), "nothing of the dead one goes on beside it"
    assert is_running(web) and is_running(broker)
    run.process.send_signal(signal.SIGTERM)
    assert run.process.wait(10) == 0
    assert "culprit None 143" in run.said
    assert re.search(r"^\d{4}-\d\d-\d\dT[\d:.]+Z paddock\[\d+\] - beside$", run.said, re.M), "each line has its program"
    assert not any(is_running(pid) for pid in (web, broker, again))


def test_a_closed_terminal_ends_all(programs):
    run = programs("web=stays")
    web = run.started("web")
    run.process.send_signal(signal.SIGHUP)
    assert run.process.wait(10) == 0
    assert "culprit None 129" in run.said
    assert not is_running(web)


def test_a_closed_terminal_ends_nothing_under_nohup(programs):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # which a program that is started inherits
    try:
        run = programs("web=stays")
    finally:
        signal.signal(signal.SIGHUP, before)
    web = run.started("web")
    run.process.send_signal(signal.SIGHUP)
    with pytest.raises(subprocess.TimeoutExpired):
        run.process.wait(1)
    assert is_running(web)
    run.process.send_signal(signal.SIGTERM)
    assert run.process.wait(10) == 0


def test_a_program_that_is_not_vital_is_restarted_forever(programs):
    run = programs("worker=dies", "web=stays")
    run.started("worker", 7)
    assert run.process.poll() is None
    assert len(run.pids("web")) == 1


def test_a_web_server_that_keeps_dying_ends_all_and_is_named(programs):
    run = programs("web=dies", "worker=stays")
    assert run.process.wait(10) == 0
    assert "culprit web 3" in run.said
    assert len(run.pids("web")) == 5
    assert not is_running(run.pids("worker")[0])


def test_a_worker_that_failed_to_start_is_restarted(programs):
    run = programs("worker=sick first", "web=stays")
    first = run.started("worker")
    run.started("worker", 2)
    assert not is_running(first)
    assert "worker ended by itself (signal 15)" in run.said


def test_a_drained_worker_is_started_again_without_a_word(programs):
    run = programs("worker=drained", "web=stays")
    run.started("worker", 3)
    assert "ended by itself" not in run.said


def test_nothing_outlives_a_killed_supervisor(programs):
    run = programs("web=stays", "worker=stays")
    pids = [run.started("web"), run.started("worker")]
    run.process.kill()
    run.process.wait()
    wait_for(lambda: not any(is_running(pid) for pid in pids), 30)


def test_all_end_in_order_when_nobody_reads_the_log_any_more(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, "-c", SUPERVISOR, str(tmp_path), "web=stays", "worker=dies", "broker=stays"]
    with subprocess.Popen(command, cwd=CHECKOUT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        wait_for(lambda: all((tmp_path / name).exists() for name in ("web", "broker")), 10)
        running.stdout.close()
        assert running.wait(20) == 0
        assert running.stderr.read() == ""
    pids = [int(pid) for name in ("web", "broker") for pid in (tmp_path / name).read_text().split()]
    assert pids and not any(is_running(pid) for pid in pids)


def test_a_module_runs_in_a_fork_that_shares_what_is_loaded_and_no_open_file(tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", SHARING, str(tmp_path / "held")],
        cwd=CHECKOUT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as running:
        said = [running.stdout.readline().partition("] - ")[2].strip() for _ in range(6)]
        running.send_signal(signal.SIGTERM)
        told = monotonic()
        rest = running.stdout.read()
        assert running.wait(10) == 0
    assert monotonic() - told < GRACE_S, "it ended by itself"
    assert said[0] == "loaded by the supervisor"
    assert said[1] == f"{tmp_path}/held, of its own"
    assert said[2] == "default_int_handler, 0, nice 3"
    assert said[3] == "files 0 (/dev/null), 1, 2"
    assert said[4] == f"{sys.executable} -m tests.config.forked {tmp_path}/held of its own"
    assert said[5] == "the environment is the same"
    assert "stopped well" in rest
