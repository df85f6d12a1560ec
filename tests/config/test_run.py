"""The run command, really run: it starts everything, stops everything, and says clearly what is wrong."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from valkey import Valkey

from config.serving import broker
from tests.evaluation.processes import family_of, is_running, wait_for
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("run")]
# but for the cup of a day that begins meanwhile
RACES = "select id, slug, invitation from races_race where slug not like 'cup-of-the-day-%'"
# What a first start has made, whatever came after it
WHOLE = (
    "select type, name from sqlite_master order by 1, 2",
    "select app, name from django_migrations order by 1, 2",
    "select codename, model from auth_permission join django_content_type as t on t.id = content_type_id order by 1, 2",
    "select slug, fingerprint from tracks_track order by 1",
    "select slug, name from league_season",
    "select slug, opens_at from races_race where kind = 'league' order by 1",
    "select name from races_race where slug not like 'cup-of-the-day-%' order by 1",
)
READY = re.compile(r"Paddock is ready: (http://\S+)")


def environment(data: Path) -> dict[str, str]:
    ours = ("PADDOCK_", "DJANGO_", "DATABASE_URL", "CELERY_", "CACHE_URL", "PYTEST_", "STORAGE")
    return {
        **{name: value for name, value in os.environ.items() if not name.startswith(ours)},
        "PADDOCK_DATA": str(data),
    }


def manage(data: Path, *arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "manage.py", *arguments]
    return subprocess.run(command, cwd=CHECKOUT, env=environment(data), capture_output=True, text=True, timeout=120)


class Run:
    """A running ``manage.py run``."""

    def __init__(self, data: Path, port: int | None = None, **more: str) -> None:
        self.data, self.port = data, port or free_port()
        self.log = data.with_name(f"{data.name}-{self.port}.log")
        with self.log.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, "manage.py", "run", "--port", str(self.port)],
                cwd=CHECKOUT,
                env=environment(data) | more,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *exc: object) -> None:
        family = self.family()
        self.process.kill()
        self.process.wait()
        for pid in family:
            if is_running(pid) and exc[0] is not None:
                os.kill(pid, signal.SIGKILL)

    @property
    def said(self) -> str:
        return self.log.read_text()

    def ready(self) -> Run:
        wait_for(lambda: READY.search(self.said) or self.process.poll() is not None, 90, self.log)
        assert READY.search(self.said), self.said
        return self

    def answer(self, path: str = "/") -> int:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=10) as page:
                return page.status
        except urllib.error.HTTPError as error:
            return error.code

    def family(self) -> set[int]:
        """The process and all its descendants."""
        return family_of(self.process.pid)

    def pid_of(self, words: str) -> int:
        """The first descendant whose command line, with "(end)" behind it, holds ``words``."""
        for pid in sorted(self.family()):
            command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode() + "(end)"
            if words in command and "manage.py" not in command:
                return pid
        raise AssertionError(f"no {words} in the family")

    def stop(self, signum: int) -> int:
        """Send a signal, wait for the end of the whole family; the exit status."""
        family = self.family()
        assert len(family) > 6  # the run command, broker, web and its workers, worker and its pool, beat
        self.process.send_signal(signum)
        status = self.process.wait(30)
        # Seconds of processor: on a machine with other work they take their time (3 to 5 s with three such programs).
        wait_for(lambda: not any(is_running(pid) for pid in family), 20, self.log)
        return status


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def rows(data: Path, query: str) -> list[tuple]:
    with closing(sqlite3.connect(data / "paddock.sqlite3", timeout=20)) as database:
        return database.execute(query).fetchall()


@dataclass
class FirstStart:
    """What a first start did, and its data folder after it has stopped: preparing a new one takes seconds."""

    data: Path
    answers: tuple[int, int]
    seasons: int
    tracks: int
    evaluation: str  # one that has finished
    doctor: subprocess.CompletedProcess
    heartbeats: list[tuple]  # of the worker for evaluations: whether it was up, before the stop and after it
    messengers: list[tuple]  # who takes what waits for others' servers: how many, and in how many processes and threads
    status: int
    said: str


@pytest.fixture(scope="module")
def first_start(tmp_path_factory, new_data) -> FirstStart:
    data = new_data(tmp_path_factory.mktemp("run") / "data", house_cars=1)
    finished = "select public_id from evaluation_evaluation where state = 'finished'"
    with Run(data) as run:
        run.ready()
        answers = run.answer(), run.answer("/health/ready")
        wait_for(lambda: rows(data, finished), 60, run.log)
        doctor = manage(data, "doctor")
        beat = "select stopped_at is null from evaluation_workernode where queues like '%celery%'"
        alive = rows(data, beat)
        messengers = "select count(*), sum(processes) from evaluation_workernode where queues = '[\"messages\"]'"
        status = run.stop(signal.SIGINT)
    return FirstStart(
        data,
        answers,
        *rows(data, "select count(*) from league_season")[0],
        *rows(data, "select count(*) from tracks_track where is_catalogue")[0],
        *rows(data, finished)[0],
        doctor,
        alive + rows(data, beat),
        rows(data, messengers),
        status,
        run.said,
    )


def _copied(data: Path, to: Path) -> Path:
    """A data folder without the sockets that ended programs left."""
    return Path(shutil.copytree(data, to, ignore=shutil.ignore_patterns("*.sock")))


@pytest.fixture(scope="module")
def data(first_start, tmp_path_factory):
    """What the first start left, for the starts after it, one after the other."""
    return _copied(first_start.data, tmp_path_factory.mktemp("again") / "data")


def test_a_first_start_opens_a_season_and_ctrl_c_stops_it(first_start):
    assert first_start.answers == (200, 200)
    assert first_start.seasons == 1
    assert first_start.tracks >= 7
    assert first_start.doctor.returncode == 0, first_start.doctor.stdout
    assert "bundled Valkey answers" in first_start.doctor.stdout
    assert "exact: 3 of 3" in first_start.doctor.stdout
    assert first_start.heartbeats == [(True,), (False,)], "its worker wrote that it was up, and that it was shut down"
    assert first_start.messengers == [(1, 8)]
    assert first_start.status == 130
    assert "Traceback" not in first_start.said
    static = first_start.data / "static"  # what everybody is sent
    kept = [path for path in first_start.data.rglob("*") if static not in (path, *path.parents)]
    assert [path for path in kept if path.lstat().st_mode & 0o077] == []
    # the whole way is open: a house car was uploaded, queued, run in the sandbox, and has a result
    again = manage(first_start.data, "verify", first_start.evaluation)
    assert (again.returncode, again.stderr) == (0, ""), again.stdout
    assert "is the same" in again.stdout


def test_a_second_start_keeps_data_and_restarts_what_dies(data):
    secret = (data / "secret-key").read_text()
    seasons = rows(data, "select * from league_season")
    races = rows(data, RACES)
    with Run(data) as run:
        run.ready()
        second = manage(data, "run", "--port", str(free_port()))
        assert second.returncode == 1
        assert f"already running on {data} (process {run.process.pid})" in second.stderr
        assert "Traceback" not in second.stderr
        assert run.answer() == 200
        assert valkey_answers(data)
        one_dies(run, "worker", "--without-mingle (end)")  # a trainer's command goes on
        one_dies(run, "broker", "valkey-server")  # which the others need to the end
        assert run.stop(signal.SIGKILL) == -9, "and takes everything along"
    assert (data / "secret-key").read_text() == secret
    assert rows(data, "select * from league_season") == seasons
    assert rows(data, RACES) == races


def test_a_start_after_sigkill_works_and_sigterm_stops_it(data):
    """The one before is killed in the test above."""
    with Run(data) as run:
        assert run.ready().answer() == 200
        assert valkey_answers(data)
        assert run.stop(signal.SIGTERM) == 143


@pytest.mark.soak
def test_a_start_after_all_of_it_was_killed_at_once_works(first_start, tmp_path):
    data = _copied(first_start.data, tmp_path / "data")
    with Run(data) as run:
        assert run.ready().answer() == 200
        os.kill(run.pid_of("valkey-server"), signal.SIGSTOP)  # it shall not tidy up
        family = run.family()
        for pid in family:
            with suppress(ProcessLookupError):  # what ended by itself, or with its parent
                os.kill(pid, signal.SIGKILL)
        wait_for(lambda: not any(is_running(pid) for pid in family))
    assert broker.socket_path(data / "valkey").exists()  # a stale socket
    with Run(data) as run:
        assert run.ready().answer() == 200
        assert valkey_answers(data)
        assert run.stop(signal.SIGTERM) == 143


def valkey_answers(data: Path) -> bool:
    with Valkey(unix_socket_path=str(broker.socket_path(data / "valkey"))) as client:
        return client.ping()


def one_dies(run: Run, name: str, words: str) -> None:
    """Kill one program of a run: it is started again, the run says which it was, and the site answers all the while."""
    killed = run.pid_of(words)
    os.kill(killed, signal.SIGKILL)
    wait_for(lambda: f"{name} ended by itself (signal 9). It is started again in 1 s." in run.said, 30, run.log)
    assert run.answer() == 200
    wait_for(lambda: has(run, words) and run.pid_of(words) != killed, 60, run.log)
    assert run.process.poll() is None


def has(run: Run, words: str) -> bool:
    try:
        return bool(run.pid_of(words))
    except (AssertionError, FileNotFoundError):
        return False


def test_a_first_start_ends_at_once_at_any_point_and_the_next_one_continues(tmp_path):
    """The signal comes to the process of the command alone, as from systemd."""
    data = tmp_path / "data"
    points = [(signal.SIGINT, "Data folder"), (signal.SIGTERM, " database ..."), (signal.SIGHUP, " static files ...")]
    for signum, point in points:
        with Run(data) as run:
            wait_for(lambda run=run, point=point: point in run.said or run.process.poll() is not None, 400, run.log)
            family = run.family()
            assert len(family) == 2, run.said
            run.process.send_signal(signum)
            assert run.process.wait(30) == 128 + signum
            assert not any(is_running(pid) for pid in family)
            assert run.said.endswith("\nStopped.\n")  # on a line of its own
            assert "Traceback" not in run.said
    done = manage(data, "setup", "--no-input")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count(" s\n") == 4, "a line a step, with its time"
    assert rows(data, "select count(*) from league_season") == [(1,)]
    manifest = json.loads((data / "static" / "staticfiles.json").read_text())
    for name in manifest["paths"].values():
        assert (data / "static" / name).stat().st_size, name


POINTS = [(" database ...", 0.0), (" database ...", 0.2), (" static files ...", 0.3), (" of races ...", 0.2)]


@pytest.mark.parametrize("points", [POINTS[1::2], pytest.param(POINTS, marks=pytest.mark.soak)], ids=["two", "all"])
def test_a_first_start_that_is_killed_at_any_point_is_completed_by_the_next(first_start, tmp_path, points):
    data = tmp_path / "data"
    for point, later_s in points:
        with Run(data) as run:
            wait_for(lambda run=run, point=point: point in run.said or run.process.poll() is not None, 400, run.log)
            family = run.family()
            run.process.poll() or threading.Event().wait(later_s)
            run.process.kill()
            assert run.process.wait(30) == -signal.SIGKILL, run.said
            wait_for(lambda family=family: not any(is_running(pid) for pid in family), 30, run.log)
    done = manage(data, "setup", "--no-input")
    assert (done.returncode, done.stderr) == (0, "")
    for query in WHOLE:
        assert rows(data, query) == rows(first_start.data, query)


def test_a_port_in_use_is_refused_before_anything_starts(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        refused = manage(tmp_path / "data", "run", "--port", str(port))
    assert refused.returncode == 1
    assert f"cannot listen on 127.0.0.1 port {port}" in refused.stderr
    assert f"PORT={port + 1}" in refused.stderr
    assert not (tmp_path / "data" / "paddock.sqlite3").exists()


def test_a_killed_preparation_is_named(tmp_path):
    """As the kernel kills it when memory is short."""
    with Run(tmp_path / "data") as run:
        wait_for(lambda: " database ..." in run.said, 400, run.log)
        (child,) = run.family() - {run.process.pid}
        os.kill(child, signal.SIGKILL)
        assert run.process.wait(30) == 137
        assert "The preparation was killed (signal 9). The next start continues it." in run.said
