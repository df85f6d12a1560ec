"""A whole site in the worst of weathers: everything is killed, storage and broker go and come back.

Whatever was accepted gets its result: nothing is lost, nothing counts twice, nothing fails for good, and the same car
has the same result wherever it was driven.
"""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from http.client import HTTPException
from pathlib import Path

import boto3
import pytest

from tests.config.test_run import environment, free_port
from tests.evaluation.processes import family_of
from tests.outages.bucket import BUCKET, KEY, S3Server
from tests.postgres import postgres
from tests.servers import short_folder
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.soak, pytest.mark.xdist_group("storm")]

# STORM_SHARE makes a smaller one, to look at
SHARE = float(os.environ.get("STORM_SHARE", "1"))
RACERS, RACES = 20, max(2, round(50 * SHARE))
KILLS = round(300 * SHARE)
KILL_EVERY_S = 1.2
EVERYTHING = 0.02  # of the kills: the supervisor, and all ends with it
AWAY_S = 20.0
LIMIT_S = 45 * 60.0
SUBMITTERS = 3
_GONE = frozenset({502, 503, 504})


@dataclass
class Place:
    """Where a site keeps its things. ``storage_away``, ``broker_away``: it is gone within the block."""

    settings: dict[str, str]
    storage_away: Callable[[], AbstractContextManager]
    broker_away: Callable[[], AbstractContextManager]


@dataclass
class Seen:
    """What was met on the way."""

    accepted: Counter = field(default_factory=Counter)
    answers: Counter = field(default_factory=Counter)
    killed: Counter = field(default_factory=Counter)
    starts: int = 0


class Storm:
    """A site, those who send cars to it, and whatever hits it."""

    def __init__(self, place: Place, log: Path, seed: int) -> None:
        self.place, self.log, self.seen = place, log, Seen()
        self.luck = random.Random(seed)
        self.port = free_port()
        self.over = threading.Event()
        self.site: subprocess.Popen | None = None

    def program(self, *arguments: str) -> dict:
        """What ``tests.config.site_storm`` prints."""
        command = [sys.executable, "-m", "tests.config.site_storm", *arguments]
        done = subprocess.run(command, cwd=CHECKOUT, env=self.place.settings, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-4000:]
        return json.loads(done.stdout.splitlines()[-1])

    def keep(self) -> None:
        """Start the site, and again whenever it has ended, as the service manager of a machine does."""
        while not self.over.is_set():
            if self.site is None or self.site.poll() is not None:
                self.start()
            self.over.wait(0.5)

    def start(self) -> None:
        command = [sys.executable, "manage.py", "run", "--port", str(self.port)]
        with self.log.open("ab") as output:
            self.site = subprocess.Popen(
                command, cwd=CHECKOUT, env=self.place.settings, stdout=output, stderr=output, start_new_session=True
            )
        self.seen.starts += 1

    def stop(self) -> None:
        """End the site and all that it started."""
        self.over.set()
        if self.site is not None:
            family = family_of(self.site.pid)
            self.site.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self.site.wait(60)
            for pid in family:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            self.site.wait(20)

    def ready(self) -> bool:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{self.port}/health/ready", timeout=5).close()
        except OSError:
            return False
        return True

    def kill(self) -> None:
        """SIGKILL to any process of the site's: broker, web server, workers, sandboxes, and now and then all of it."""
        while sum(self.seen.killed.values()) < KILLS and not self.over.wait(KILL_EVERY_S):
            if self.site is None or not (family := sorted(family_of(self.site.pid) - {self.site.pid})):
                continue
            everything = self.luck.random() < EVERYTHING
            pid = self.site.pid if everything else self.luck.choice(family)
            with suppress(OSError):
                name = _name(pid)
                os.kill(pid, signal.SIGKILL)
                self.seen.killed[name] += 1

    def send(self, cars: list[tuple[str, str, str]]) -> None:
        """Send each car (token, model, race) until the site says that it has it."""
        while cars:
            token, model, race = cars.pop()
            while not self.over.is_set():
                status, body = self.call(token, f"races/{race}/submissions/", {"model": model})
                self.seen.answers[status] += 1
                if status == 201:
                    self.seen.accepted[body["evaluation"]] += 1
                    break
                if body.get("code") in ("car_already_submitted", "submission_running"):
                    break  # an answer that did not arrive had accepted it
                self.over.wait(0.3)

    def call(self, token: str, path: str, content: dict) -> tuple[int, dict]:
        """Status (0: no answer) and body."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}/api/v1/{path}",
            json.dumps(content).encode(),
            {"Content-Type": "application/json", "Authorization": f"Token {token}"},
        )
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as error:
            told = error.read()
            with suppress(ValueError):
                return error.code, json.loads(told)
            return error.code, {}
        except (OSError, ValueError, HTTPException):
            return 0, {}


@contextmanager
def embedded(folder: Path) -> Iterator[Place]:
    """SQLite, the bundled broker, files in a folder."""
    data = folder / "d"

    @contextmanager
    def storage_away() -> Iterator[None]:
        files, aside = data / "files", data / "files.aside"
        files.rename(aside)
        files.write_text("no folder")
        try:
            yield
        finally:
            files.unlink()
            aside.rename(files)

    @contextmanager
    def broker_away() -> Iterator[None]:
        """Hung, and then killed; the supervisor starts another."""
        servers = [int(entry.parent.name) for entry in Path("/proc").glob("[0-9]*/cmdline") if _is_broker(entry, data)]
        for pid in servers:
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in servers:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    yield Place(_settings(data), storage_away, broker_away)


@contextmanager
def grown(folder: Path) -> Iterator[Place]:
    """PostgreSQL, Redis, files in S3."""
    redis = _Redis(folder)
    bucket = S3Server()
    key = {"AWS_ACCESS_KEY_ID": KEY["access_key"], "AWS_SECRET_ACCESS_KEY": KEY["secret_key"]}
    where = {"AWS_ENDPOINT_URL": bucket.address, "AWS_DEFAULT_REGION": "us-east-1", "STORAGE": f"s3://{BUCKET}"}

    @contextmanager
    def storage_away() -> Iterator[None]:
        bucket.be("stopped")
        try:
            yield
        finally:
            bucket.be("")

    @contextmanager
    def broker_away() -> Iterator[None]:
        redis.stop()
        try:
            yield
        finally:
            redis.start()

    try:
        names = {"endpoint_url": bucket.address, "region_name": "us-east-1"}
        boto3.client("s3", aws_access_key_id="a-key", aws_secret_access_key="a-secret", **names).create_bucket(
            Bucket=BUCKET
        )
        redis.start()
        with postgres() as url:
            ours = {"DATABASE_URL": url, "CELERY_BROKER_URL": redis.url, **key, **where}
            yield Place(_settings(folder / "d") | ours, storage_away, broker_away)
    finally:
        redis.stop()
        bucket.close()


class _Redis:
    """A Redis server that goes and comes back, as empty as it began."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._port = folder, free_port()
        self._process: subprocess.Popen | None = None
        self.url = f"redis://127.0.0.1:{self._port}/0"

    def start(self) -> None:
        options = ["--port", str(self._port), "--bind", "127.0.0.1", "--save", "", "--dir", str(self._folder)]
        self._process = subprocess.Popen(["redis-server", *options], stdout=subprocess.DEVNULL)
        _until(self._answers, 30)

    def _answers(self) -> bool:
        with socket.socket() as client:
            return client.connect_ex(("127.0.0.1", self._port)) == 0

    def stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()


def _name(pid: int) -> str:
    """What a process is. OSError when it is gone."""
    said = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    known = {"manage.py run": "everything", "config.web": "web", "valkey": "broker", "--queues training": "trainer"}
    known |= {
        "--queues videos": "video-worker",
        "--queues messages": "messenger",
        "celery": "worker",
        "bwrap": "sandbox",
    }
    return next((name for part, name in known.items() if part in said), "runner or policy")


def _is_broker(cmdline: Path, data: Path) -> bool:
    try:
        said = cmdline.read_bytes()
    except OSError:
        return False
    return b"valkey" in said and os.fsencode(data) in said


def _settings(data: Path) -> dict[str, str]:
    """The environment of a site with its data in a folder."""
    return {
        **environment(data),
        "DJANGO_SETTINGS_MODULE": "config.settings",
        "OMP_NUM_THREADS": "1",
        "PADDOCK_WORKER_CONCURRENCY": "2",
        "PADDOCK_LEASE_SECONDS": "15",
    }


@pytest.mark.parametrize("where", [embedded, grown])
def test_every_accepted_car_gets_its_result_once(where, tmp_path):
    with short_folder() as folder, where(folder) as place:
        storm = Storm(place, tmp_path / "site.log", seed=1)
        try:
            found = ride_out(storm)
        finally:
            storm.stop()
    print(json.dumps(found | {"submitted": len(found["submitted"])}, indent=1))
    assert found["states"] == {"finished": len(found["submitted"])}, "nothing failed for good, nothing waits"
    assert found["results"] == found["submissions"] == found["sent"], "nothing lost, nothing doubled"
    assert found["accepted_twice"] == 0 and found["accepted_and_lost"] == 0
    assert (found["cars"], found["cars_with_two_results"]) == (RACERS, 0)
    assert found["kills"] == KILLS
    assert set(found["answers"]) <= {"0", "201", "409", "400", *map(str, _GONE)}, "no 500"


def ride_out(storm: Storm) -> dict:
    """Send all cars while everything is hit; what came of it once nothing waits any more."""
    began = time.monotonic()
    keeper = threading.Thread(target=storm.keep)
    keeper.start()
    _until(storm.ready, 180)
    prepared = storm.program("prepare", str(RACERS), str(RACES))
    cars = [(token, model, race) for token, model in prepared["cars"].items() for race in prepared["races"]]
    sent = len(cars)
    storm.luck.shuffle(cars)
    threads = [threading.Thread(target=storm.send, args=(cars,)) for _ in range(SUBMITTERS)]
    threads.append(threading.Thread(target=storm.kill))
    for thread in threads:
        thread.start()
    for away in (storm.place.storage_away, storm.place.broker_away) * 2:
        if not storm.over.wait(KILLS * KILL_EVERY_S / 6):
            with away():
                storm.over.wait(AWAY_S)
    for thread in threads:
        thread.join(max(0.0, began + LIMIT_S - time.monotonic()))
    found: dict = {}

    def is_done() -> bool:
        found.update(storm.program("audit"))
        return not set(found["states"]) & {"queued", "running"}

    _until(is_done, began + LIMIT_S - time.monotonic(), every_s=10)
    storm.over.set()
    keeper.join(60)
    accepted = storm.seen.accepted
    return found | {
        "sent": sent,
        "accepted": len(accepted),
        "accepted_twice": sum(count > 1 for count in accepted.values()),
        "accepted_and_lost": len(set(accepted) - set(found["submitted"])),
        "answers": {str(status): count for status, count in sorted(storm.seen.answers.items())},
        "kills": sum(storm.seen.killed.values()),
        "killed": dict(storm.seen.killed.most_common()),
        "starts": storm.seen.starts,
        "seconds": round(time.monotonic() - began),
    }


def _until(holds: Callable[[], bool], limit_s: float, every_s: float = 0.5) -> None:
    deadline = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {limit_s:.0f} s"
        time.sleep(every_s)
