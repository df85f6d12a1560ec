"""From upload to ranked row through the running site, over HTTP as a racer's own program would do it."""

from __future__ import annotations

import contextlib
import http.cookiejar
import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

from .models import CHECKOUT, Car

START_S, RANK_S, STOP_S = 120.0, 120.0, 30.0
_POLL_S = 0.05  # a page that is looked at polls every second or so; here the measured moment counts
_ALIAS, _PASSWORD = "benchmark", "correct horse battery staple"
_TOKEN = re.compile(r'name="csrfmiddlewaretoken" value="([^"]+)"')
PARTS = ("upload_s", "enter_s", "submit_s", "queue_s", "evaluate_s", "rank_s")


class SiteError(Exception):
    """The site did not do what it should; the message says what."""


def measure(cars: Sequence[Car], track: str, *, laps: int, runs: int) -> dict[str, Any]:
    """Start a site on an empty data folder, race each car ``runs`` times, stop it. Medians in seconds, in all and by
    car: ``total_s`` and its parts (the upload with conversion and gate; entering; submitting; waiting in the queue;
    the evaluation; from its end to the ranked row as read over HTTP). ``BENCH_SITE`` in the environment: a data folder
    to begin with a copy of.

    Raises SiteError with the last lines of the site's log.
    """
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as folder:
        data = Path(folder)
        if ready := os.environ.get("BENCH_SITE"):
            shutil.copytree(ready, data / "state")
        with _running_site(data) as url:
            _wait_until_idle(data)
            racer = _Racer(url)
            racer.sign_up()
            racer.race(cars[0], track, laps)  # every process has then loaded what it needs
            _wait_until_idle(data)
            found = {car.name: [racer.race(car, track, laps) for _ in range(runs)] for car in cars}
    every = [run for runs_of_car in found.values() for run in runs_of_car]
    return {**_medians(every), "models": {name: _medians(runs_of_car) for name, runs_of_car in found.items()}}


def _medians(runs: list[dict[str, float]]) -> dict[str, float]:
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


class _Racer:
    """A racer who signs up on the page and races through the API."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._token = ""

    def sign_up(self) -> None:
        """Through the site's own form, and then a token for the API."""
        jar = urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
        opener = urllib.request.build_opener(jar)
        address = f"{self._url}/accounts/signup/"
        found = _TOKEN.search(opener.open(address, timeout=30).read().decode())
        if found is None:
            raise SiteError("the page for signing up has no form")
        form = {
            "csrfmiddlewaretoken": found.group(1),
            "username": _ALIAS,
            "email": "benchmark@example.org",
            "password1": _PASSWORD,
            "password2": _PASSWORD,
        }
        request = urllib.request.Request(address, urllib.parse.urlencode(form).encode(), {"Referer": address})
        opener.open(request, timeout=30).close()
        self._token = self._call("POST", "auth/token/", {"login": _ALIAS, "password": _PASSWORD})["token"]

    def race(self, car: Car, track: str, laps: int) -> dict[str, float]:
        """One car in a single race: seconds by part."""
        now = datetime.now(UTC)
        race = self._call(
            "POST",
            "races/",
            {
                "name": f"Benchmark {uuid.uuid4().hex[:12]}",
                "track": track,
                "laps": laps,
                "minimum_laps": laps,
                "opens_at": (now - timedelta(minutes=1)).isoformat(),
                "closes_at": (now + timedelta(days=2)).isoformat(),
            },
        )
        at = f"races/{race['slug']}/"
        moments = [time.perf_counter()]
        model = self._upload(car)
        moments.append(time.perf_counter())
        self._call("POST", f"{at}entry/")
        moments.append(time.perf_counter())
        sent = self._call("POST", f"{at}submissions/", {"model": model["public_id"]})
        moments.append(time.perf_counter())
        evaluation = self._wait_until_ranked(at, sent["evaluation"])
        ranked = time.perf_counter()
        self._call("POST", f"{at}cancel/", {"reason": "measured"})
        uploaded, entered, submitted = (after - before for before, after in pairwise(moments))
        queued, started, ended = (
            datetime.fromisoformat(evaluation[key]) for key in ("queued_at", "started_at", "ended_at")
        )
        queue, evaluated = (started - queued).total_seconds(), (ended - started).total_seconds()
        return {
            "total_s": ranked - moments[0],
            "upload_s": uploaded,
            "enter_s": entered,
            "submit_s": submitted,
            "queue_s": queue,
            "evaluate_s": evaluated,
            "rank_s": ranked - moments[0] - uploaded - entered - submitted - queue - evaluated,
            "sandboxed_s": evaluation["result"]["wall_s"],
        }

    def _wait_until_ranked(self, at: str, public_id: str) -> dict[str, Any]:
        deadline = time.monotonic() + RANK_S
        while time.monotonic() < deadline:
            entry = self._call("GET", f"{at}entry/")
            if entry["rank"] is not None:
                return self._call("GET", f"evaluations/{public_id}/")
            evaluation = self._call("GET", f"evaluations/{public_id}/")
            if evaluation["reason"]:
                raise SiteError(f"the evaluation ended without a result: {evaluation['reason']}")
            if evaluation["result"] and not entry["classified"] and self._call("GET", f"{at}entry/")["rank"] is None:
                raise SiteError(f"the car is not classified: {evaluation['result']['laps']}")
            time.sleep(_POLL_S)
        raise SiteError(f"no rank after {RANK_S:g} s")

    def _upload(self, car: Car) -> dict[str, Any]:
        names = ("package",) if len(car.files) == 1 else ("model", "metadata")
        boundary = uuid.uuid4().hex
        body = bytearray()
        for field, (name, content) in zip(names, car.files, strict=True):
            head = f'--{boundary}\r\nContent-Disposition: form-data; name="{field}"; filename="{name}"\r\n\r\n'
            body += head.encode() + content + b"\r\n"
        body += f"--{boundary}--\r\n".encode()
        return self._send("POST", "models/", bytes(body), f"multipart/form-data; boundary={boundary}")

    def _call(self, method: str, path: str, content: dict[str, Any] | None = None) -> Any:
        return self._send(method, path, None if content is None else json.dumps(content).encode(), "application/json")

    def _send(self, method: str, path: str, body: bytes | None, kind: str) -> Any:
        request = urllib.request.Request(f"{self._url}/api/v1/{path}", body, {"Content-Type": kind}, method=method)
        if self._token:
            request.add_header("Authorization", f"Token {self._token}")
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.loads(answer.read() or b"null")
        except urllib.error.HTTPError as error:
            raise SiteError(f"{method} {path}: {error.code} {error.read()[:500]!r}") from None


@contextlib.contextmanager
def _running_site(data: Path) -> Iterator[str]:
    """``manage.py run`` on a free port with its state in ``data``; yields its address once it is ready."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = data / "benchmark.log"
    with log.open("wb") as output:
        site = subprocess.Popen(
            [sys.executable, "manage.py", "run", "--port", str(port)],
            cwd=CHECKOUT,
            env=environment(data / "state"),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    url = f"http://127.0.0.1:{port}"
    try:
        _wait_until_ready(site, url)
        yield url
    except (SiteError, OSError, sqlite3.Error) as error:
        tail = log.read_text(errors="replace")[-4000:]
        raise SiteError(f"{error}\nThe site's log ends with:\n{tail}") from error
    finally:
        stop(site)


def stop(site: subprocess.Popen[Any]) -> None:
    """End a site as Ctrl-C does, or kill it after :data:`STOP_S`."""
    site.send_signal(signal.SIGINT)
    try:
        site.wait(STOP_S)
    except subprocess.TimeoutExpired:
        site.kill()
        site.wait()


def environment(state: Path) -> dict[str, str]:
    """This process's environment without a word about any other installation's database, broker or settings."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PADDOCK_")}
    for name in ("DATABASE_URL", "CELERY_BROKER_URL", "CACHE_URL", "STORAGE", "EMAIL_URL"):
        kept.pop(name, None)
    return {
        **kept,
        "DJANGO_SETTINGS_MODULE": "config.settings",
        "PADDOCK_DATA": str(state),
        "OMP_NUM_THREADS": "1",
    }


def _wait_until_ready(site: subprocess.Popen, url: str) -> None:
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline:
        if site.poll() is not None:
            raise SiteError(f"the site ended with status {site.returncode}")
        try:
            urllib.request.urlopen(f"{url}/health/ready", timeout=5).close()
            return
        except OSError:
            time.sleep(0.2)
    raise SiteError(f"the site was not ready after {START_S:g} s")


def _wait_until_idle(data: Path) -> None:
    """Until no evaluation waits or runs: a fresh site races its house cars, which would share the cores."""
    deadline = time.monotonic() + START_S
    database = f"file:{data / 'state' / 'paddock.sqlite3'}?mode=ro"
    while time.monotonic() < deadline:
        with contextlib.closing(sqlite3.connect(database, uri=True, timeout=20)) as connection:
            query = "select count(*) from evaluation_evaluation where state in ('queued', 'running')"
            if connection.execute(query).fetchone() == (0,):
                return
        time.sleep(0.2)
    raise SiteError(f"the house cars were not done after {START_S:g} s")
