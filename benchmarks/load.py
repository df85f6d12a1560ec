"""Requests a second of board pages, beside a Django view that does nothing: the same server program, in turns.

``wrk`` (Debian's package of that name) asks through as many connections as the server has threads. It shares the cores
with the server, so each figure is also told for a second of processor time of the server's processes.
"""

from __future__ import annotations

import http.client
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CONNECTIONS = 4
TURNS = 3
START_S = 60.0
ANSWER_S = 5.0
BARE = "a bare Django view"
MISSING = "there is no wrk: install the package wrk, or measure without load (--load 0)"
_RATE = re.compile(r"Requests/sec:\s+([\d.]+)")
_SERVED = re.compile(r"(\d+) requests in")
_FAILED = re.compile(r"Non-2xx or 3xx responses: (\d+)|Socket errors: (.*)")


class LoadError(Exception):
    """The load could not be measured; the message says why."""


def is_there() -> bool:
    """Whether ``wrk`` is installed."""
    return shutil.which("wrk") is not None


def measure(races: Mapping[int, Any], seconds: int, turns: int = TURNS) -> dict[str, dict[str, float]]:
    """Best of ``turns`` for the board page and the API's page of each race, and for the bare view: ``per_second`` on
    the clock, ``per_processor_second`` of the server. ``races``: by how many entries they have. The database is the one
    that Django is set up on.

    Raises LoadError: no ``wrk``, a server that does not start, answers that are errors.
    """
    if not is_there():
        raise LoadError(MISSING)
    with server("config.wsgi") as (site, site_pid), server("benchmarks.bare") as (bare, bare_pid):
        targets = {BARE: (f"{bare}/", bare_pid)}
        for size, race in races.items():
            targets[f"page of {size:,}"] = (f"{site}{race.get_absolute_url()}", site_pid)
            targets[f"API of {size:,}"] = (f"{site}/api/v1/races/{race.slug}/board/", site_pid)
        found: dict[str, dict[str, float]] = {name: {} for name in targets}
        for turn in range(turns + 1):
            for name, (address, pid) in targets.items():
                figures = _wrk(address, pid, seconds if turn else 1)
                if turn:  # the first warms up
                    found[name] = {key: max(value, found[name].get(key, 0.0)) for key, value in figures.items()}
    return found


def _wrk(address: str, server: int, seconds: int) -> dict[str, float]:
    before = processor_s(server)
    command = ["wrk", "-t1", f"-c{CONNECTIONS}", f"-d{seconds}s", "--timeout", "30s", address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + 60)
    rate, failed = _RATE.search(done.stdout), _FAILED.search(done.stdout)
    served = _SERVED.search(done.stdout)
    if rate is None or served is None or failed:
        raise LoadError(f"{address}: {done.stdout}{done.stderr}")
    return {
        "per_second": float(rate[1]),
        "per_processor_second": int(served[1]) / max(processor_s(server) - before, 1e-9),
    }


def processor_s(parent: int) -> float:
    """Processor time of a process's children: those that serve."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    ticks = 0
    for child in children:
        after_name = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
        ticks += int(after_name[11]) + int(after_name[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def _answers(port: int) -> bool:
    """Whether a request is answered: to be connected only says that somebody listens."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=ANSWER_S)
    try:
        connection.request("GET", "/")
        return connection.getresponse().status < 500
    except (OSError, http.client.HTTPException):
        return False
    finally:
        connection.close()


@contextmanager
def server(application: str, processes: int = 1) -> Iterator[tuple[str, int]]:
    """The web server as the run command starts it; yields its address and process id.

    Raises LoadError where it does not start, or answers nothing.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"127.0.0.1:{port}"
    command = [sys.executable, "-m", "config.web", "--port", str(port), "--application", f"{application}:application"]
    command += ["--processes", str(processes), "--threads", str(CONNECTIONS)]
    program = subprocess.Popen(command, start_new_session=True)
    try:
        deadline = time.monotonic() + START_S
        while not _answers(port):
            if program.poll() is not None or time.monotonic() > deadline:
                raise LoadError(f"{application} did not start")
            time.sleep(0.1)
        yield f"http://{address}", program.pid
    finally:
        program.send_signal(signal.SIGTERM)
        try:
            program.wait(20)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()
