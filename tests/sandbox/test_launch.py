"""Starting, feeding, limiting and ending a sandboxed process."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from evaluation.sandbox.frames import FrameClosed, FrameTimeout, read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import POLICY, STDERR_LIMIT
from evaluation.sandbox.lock import EXIT_IMPORT, EXIT_MEMORY, EXIT_NOT_LOCKED
from evaluation.sandbox.start import LEVEL_NAMESPACES
from paddock.errors import PlatformFault
from paddock.simulator.camera.warp import best_warp
from tests.shared import CHECKOUT

from .conftest import PAYLOADS
from .payloads import draws

pytestmark = pytest.mark.usefixtures("nothing_left")
SMALL = replace(POLICY, address_space_mb=256, wall_s=20)


def start(what, level, limits=SMALL, **options):
    return launch("resources", limits=limits, arguments=[what], python_path=[PAYLOADS], level=level, **options)


def test_input_comes_back_unchanged(level):
    with start("echo", level) as process:
        write_message(process.stdin, {"a": 1}, [b"x" * 300_000], process.deadline)
        assert read_message(process.stdout, process.deadline) == ({"a": 1}, [b"x" * 300_000])
        assert process.wait(30) == 0


def test_the_launchers_environment_stays_outside(level, monkeypatch):
    monkeypatch.setenv("SECRET_KEY", "hunter2")
    monkeypatch.setenv("DATABASE_URL", "postgres://")
    with start("describe", level) as process:
        found, _ = read_message(process.stdout, process.deadline)
    assert found["leaked"] == []
    assert found["modules"] == []


def test_frames_are_drawn_the_same_in_the_sandbox(level):
    with launch("draws", limits=replace(SMALL, address_space_mb=1024), python_path=[PAYLOADS], level=level) as process:
        found, _ = read_message(process.stdout, process.deadline)
    assert found == {"way": best_warp().__name__, "frame": draws.digest()}


@pytest.mark.skipif(os.geteuid() != 0, reason="only a root launcher hands out user ids")
def test_a_root_launcher_gives_each_process_a_user_id_of_its_own(level):
    with start("describe", level) as one, start("describe", level) as other:
        uids = {read_message(process.stdout, process.deadline)[0]["uid"] for process in (one, other)}
    assert len(uids) == 2
    assert min(uids) >= 1000


def test_the_locked_process_is_one_thread_without_capabilities(level):
    with start("ignore_signals", level) as process:
        read_message(process.stdout, process.deadline)
        with open(f"/proc/{process.inner_pid}/status") as lines:
            status = dict(line.rstrip("\n").split(":\t", 1) for line in lines if ":\t" in line)
    assert status["Threads"] == "1"
    assert status["NoNewPrivs"] == "1"
    assert status["Seccomp"] == "2"
    assert {int(status[name], 16) for name in ("CapInh", "CapPrm", "CapEff", "CapAmb")} == {0}
    assert "0" not in status["Uid"].split()


@pytest.mark.parametrize("what", ["grow_memory", "grow_memory_by_touching_one_block"])
def test_memory_is_limited(level, what):
    with start(what, level) as process:
        assert process.wait(10) == EXIT_MEMORY


@pytest.mark.parametrize(("status", "told"), [(127, 127), (128, -31), (137, -31), (200, -31), (-1, -31)])
def test_an_exit_status_cannot_pass_for_an_outside_signal(level, status, told):
    """What would look like one ends it with SIGSYS: 137 is what bubblewrap says of SIGKILL."""
    arguments = ["end_with", str(status)]
    with launch("resources", limits=SMALL, arguments=arguments, python_path=[PAYLOADS], level=level) as process:
        assert process.wait(10) == told


def test_cpu_time_is_limited(level):
    with start("burn_processor_time", level, replace(SMALL, cpu_s=1)) as process:
        assert process.wait(10) == -signal.SIGXCPU
        assert 1 <= process.cpu_s < 2


def test_a_flood_on_stderr_is_capped_and_stops_nobody(level):
    with start("flood_stderr", level) as process:
        assert read_message(process.stdout, process.deadline)[0] == {"done": True}
        assert process.wait(30) == 0
        assert 0 < len(process.stderr_text()) <= STDERR_LIMIT


def test_an_endless_flood_blocks_only_itself(level):
    with start("flood_stderr_for_ever", level) as process:
        with pytest.raises(FrameTimeout):
            read_message(process.stdout, time.monotonic() + 0.5)
        assert process.poll() is None
        process.kill()
        assert len(process.stderr_text()) <= STDERR_LIMIT


def test_control_characters_do_not_reach_an_operators_terminal(level):
    with start("paint_the_terminal", level) as process:
        process.wait(30)
        assert process.stderr_text() == "?]0;owned?\N{REPLACEMENT CHARACTER}\nplain"


def test_a_process_that_ignores_every_signal_is_killed(level):
    with start("ignore_signals", level) as process:
        read_message(process.stdout, process.deadline)
        os.kill(process.inner_pid, signal.SIGTERM)
        assert process.wait(0.1) is None
        started = time.monotonic()
        process.kill()
        assert time.monotonic() - started < 5
        assert process.poll() == -signal.SIGKILL


def test_a_detached_grandchild_dies_with_its_namespace(level):
    if level < LEVEL_NAMESPACES:
        pytest.skip("without namespaces only the lock forbids children, and it does (test_escape)")
    with start("detach", level) as process:
        read_message(process.stdout, process.deadline)
        members = _namespace_of(process.inner_pid)
        assert len(members) >= 3  # bubblewrap's first process, the payload, and the daemon that it left
    assert not any(os.path.exists(f"/proc/{pid}") for pid in members)


def _namespace_of(pid):
    """Every process in the pid namespace of ``pid``."""
    wanted = os.readlink(f"/proc/{pid}/ns/pid")
    members = []
    for name in os.listdir("/proc"):
        if name.isdigit():
            with contextlib.suppress(OSError):
                if os.readlink(f"/proc/{name}/ns/pid") == wanted:
                    members.append(int(name))
    return members


def test_killing_the_launcher_kills_the_process(level):
    code = (
        "import sys, time\n"
        "from evaluation.sandbox.launch import launch\n"
        "from evaluation.sandbox.limits import POLICY\n"
        "from evaluation.sandbox.frames import read_message\n"
        f"process = launch('resources', limits=POLICY, arguments=['ignore_signals'], python_path=[{str(PAYLOADS)!r}],"
        f" level={level})\n"
        "read_message(process.stdout, process.deadline)\n"
        "print(process.pid, process.inner_pid, process._first or process.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=CHECKOUT, stdout=subprocess.PIPE, text=True) as launcher:
        pids = {int(word) for word in launcher.stdout.readline().split()}
        descriptors = [os.pidfd_open(pid) for pid in pids]
        launcher.kill()
    assert len(pids) == (1 if level < LEVEL_NAMESPACES else 3)
    for fd in descriptors:
        poller = select.poll()
        poller.register(fd, select.POLLIN)
        assert poller.poll(5000), "it outlived its launcher"
        with contextlib.suppress(ChildProcessError):
            os.waitid(os.P_PIDFD, fd, os.WEXITED)  # it came to us: see nothing_left
        os.close(fd)


def test_closing_twice_is_harmless(level):
    process = start("sleep", level)
    process.close()
    process.close()
    assert process.poll() == -signal.SIGKILL


def test_a_process_killed_at_once_leaves_nothing(level):
    for _ in range(5):
        start("sleep", level).close()


def test_a_module_that_cannot_be_imported_says_so(level):
    with launch("never_imports", limits=SMALL, python_path=[PAYLOADS], level=level) as process:
        with pytest.raises(FrameClosed):
            read_message(process.stdout, process.deadline)
        assert process.wait(30) == EXIT_IMPORT
        assert "nothing here" in process.stderr_text()


def test_a_process_with_two_threads_does_not_pass_the_lock(level):
    with launch("has_a_thread", limits=SMALL, python_path=[PAYLOADS], level=level) as process:
        assert process.wait(30) == EXIT_NOT_LOCKED
        assert "thread" in process.stderr_text()


@pytest.mark.parametrize("asked", [0, 1, 4])
def test_only_levels_from_the_minimum_to_the_hosts_start(asked):
    with pytest.raises(PlatformFault) as caught:
        start("sleep", asked)
    assert caught.value.code == "sandbox_unavailable"


def test_a_module_outside_the_given_path_cannot_run(level):
    with launch("tests.shared", limits=SMALL, level=level) as process:
        status = process.wait(30)
    if level >= LEVEL_NAMESPACES:
        assert status == EXIT_IMPORT
    else:
        assert status != 0  # importable before the lock, but it has no main()


def test_namespaces_show_only_code_and_allow_no_writing(level):
    if level < LEVEL_NAMESPACES:
        pytest.skip("without namespaces the file system is there until the lock")
    with launch("looks_around", limits=SMALL, python_path=[PAYLOADS], level=level) as process:
        found, _ = read_message(process.stdout, process.deadline)
    assert found["writable"] == []
    assert not found["network"]
    assert found["pid"] < 10
    outside = ("/etc/", "/var/", "/home/", "/tmp/", "/run/", "/dev/", "/boot/", "/opt/", "/usr/bin/", "/bin/")
    interpreter = (
        *map(os.path.realpath, (sys.executable, sys.base_prefix)),
        sys.base_prefix,
        sys.prefix,
    )  # wherever they are installed
    elsewhere = [path for path in found["visible"] if not _within(path, CHECKOUT) and not path.startswith(interpreter)]
    assert [path for path in elsewhere if path.startswith(outside)] == []
    ours = {path.removeprefix(f"{CHECKOUT}/").split("/")[0] for path in found["visible"] if _within(path, CHECKOUT)}
    assert ours <= {"evaluation", "paddock", "training", "tests", ".venv"}
    tests = {path for path in found["visible"] if _within(path, CHECKOUT / "tests")}
    assert all(_within(path, PAYLOADS) for path in tests)
    assert [path for path in found["visible"] if path.startswith("/proc/")] == ["/proc/cpuinfo"]


def _within(path, directory):
    return path.startswith(f"{directory}/")
