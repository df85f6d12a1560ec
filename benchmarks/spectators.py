"""``python -m benchmarks.spectators [--json]``: many who ask for the same pages of a running site.

Guests ask for home, the races and a board of a thousand, ``--rate`` times a second, and signed-in racers for the board
``--racers-rate`` times, without writes and while ``--writes`` results a second are committed. Beside them, in the same
run: a Django view that does nothing, from the same web server, at both rates. Latency counts from the time a request
was due, so a server that falls behind shows it. Processor time is that of the web server's processes, and holds on a
loaded machine where latency does not. The site has its own database (``--postgres``: on a separate server).
"""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

from .board import database, oval
from .board_rows import counted_at_the_end, fill, make_race, make_racers
from .load import BARE, processor_s, server
from .report import command, report

RATE, SECONDS, READERS = 500, 6.0, 50
RACERS_RATE, RACERS = 200, 200
WRITES = 10
ENTRIES = 1_000
P95_MS, ACHIEVED = 100.0, 0.95  # promised: the latency, at so much of the rate
QUIET, WRITTEN = "no writes", "results"


async def _ask(address: str, rate: int, seconds: float, cookies: Sequence[str]) -> dict[str, float]:
    """Ask ``rate`` times a second, in turns over ``READERS`` connections, with each of ``cookies`` in turn, if any."""
    where = urlsplit(address)
    took: list[float] = []
    failed = 0
    start = time.perf_counter() + 0.5

    async def reader(number: int) -> None:
        nonlocal failed
        incoming, outgoing = await asyncio.open_connection(where.hostname, where.port)
        for turn in range(int(rate * seconds / READERS)):
            place = turn * READERS + number
            cookie = f"Cookie: {cookies[place % len(cookies)]}\r\n" if cookies else ""
            due = start + place / rate
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            outgoing.write(f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\n{cookie}\r\n".encode())
            head = (await incoming.readuntil(b"\r\n\r\n")).lower()
            length = int(head.partition(b"content-length: ")[2].partition(b"\r\n")[0])
            await incoming.readexactly(length)
            failed += not head.startswith(b"http/1.1 200")
            took.append(time.perf_counter() - due)
        outgoing.close()

    await asyncio.gather(*(reader(number) for number in range(READERS)))
    took.sort()
    share = {f"p{percent}_ms": round(took[len(took) * percent // 100] * 1000, 1) for percent in (50, 95, 99)}
    return {"per_second": round(len(took) / (time.perf_counter() - start)), "failed": failed, **share}


def _running(race: Any, count: int) -> list[Any]:
    """So many cars of racers on the board who have had none, each in the hands of a worker."""
    from django.utils import timezone

    from accounts.models import Racer
    from races.entries.services.submissions import submit_model
    from tests.factories import a_model, start

    now = timezone.now()
    racers = Racer.objects.filter(entries__race=race, models=None).order_by("-pk")[:count]
    waiting = [submit_model(race=race, racer=racer, model=a_model(racer), now=now) for racer in racers]
    return [start(submission.evaluation, now) for submission in waiting]


@contextmanager
def _results(running: list[Any], per_second: int) -> Iterator[list[float]]:
    """Commit ``per_second`` results a second meanwhile; yields the seconds that each took."""
    from django.db import connection
    from django.utils import timezone

    from evaluation.running.queue.jobs import finish_evaluation
    from tests.factories import laps, outcome

    done, took = threading.Event(), list[float]()

    def write() -> None:
        due = time.perf_counter()
        while running and not done.wait(max(0.0, due - time.perf_counter())):
            one, began = running.pop(), time.perf_counter()
            driven = outcome(laps(9_000 + len(running), 9_100, 9_200))
            finish_evaluation(pk=one.pk, lease=one.lease, outcome=driven, now=timezone.now())
            took.append(time.perf_counter() - began)
            due = max(due + 1.0 / per_second, time.perf_counter())
        connection.close()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield took
    finally:
        done.set()
        writer.join()


def _cookies(count: int) -> list[str]:
    """Sessions of ``count`` racers who are on the board and have a car, as they are sent."""
    from django.conf import settings
    from django.test import Client

    from accounts.models import Racer
    from tests.factories import a_model

    found = []
    for racer in Racer.objects.filter(alias__in=[f"r{number}" for number in range(count)]):
        a_model(racer)
        client = Client()
        client.force_login(racer)
        found.append(f"{settings.SESSION_COOKIE_NAME}={client.cookies[settings.SESSION_COOKIE_NAME].value}")
    return found


def measure(
    rate: int = RATE,
    seconds: float = SECONDS,
    entries: int = ENTRIES,
    writes: int = WRITES,
    racers_rate: int = RACERS_RATE,
) -> dict[str, Any]:
    """Of each page and of the bare view at its rate: ``rate`` asked for, ``per_second`` answered, ``failed``,
    ``p50_ms``, ``p95_ms``, ``p99_ms``, ``processor_ms`` of the server for a request, ``load`` of the machine, and
    ``ratio``: the processor time by the bare view's. ``results_per_second``: committed meanwhile. Django is set up on
    an empty database.

    Raises LoadError where a server does not start.
    """
    from django.db import connection
    from django.utils import timezone

    now, results_each = timezone.now(), round(writes * (seconds + 3))
    with counted_at_the_end():
        make_racers(entries, now)
        race = make_race("board", oval(), now)
        fill(race, entries, now)
    cookies, board = _cookies(RACERS), race.get_absolute_url()
    pages: dict[str, Any] = {f"guests, {path}": (path, rate, ()) for path in ("/", "/races/", board)}
    pages[f"racers, {board}"] = (board, racers_rate, cookies)
    found: dict[str, Any] = {}

    def ask(name: str, address: str, pid: int, each: int, sent: Sequence[str] = ()) -> None:
        asyncio.run(_ask(address, READERS, 1.0, sent))
        before = processor_s(pid)
        figures = asyncio.run(_ask(address, each, seconds, sent))
        spent = (processor_s(pid) - before) * 1000 / max(1, round(each * seconds))
        found[name] = {"rate": each, **figures, "processor_ms": round(spent, 2), "load": round(os.getloadavg()[0], 1)}

    with server("benchmarks.bare", 2) as (bare, pid):
        for each in sorted({rate, racers_rate}):
            ask(f"{BARE}, {each} a second", f"{bare}/", pid, each)
    with server("config.wsgi", 2) as (site, pid):
        for name, (path, each, sent) in pages.items():
            ask(f"{name}, {QUIET}", f"{site}{path}", pid, each, sent)
            running = _running(race, results_each)
            with _results(running, writes) as took:
                began = time.perf_counter()
                ask(f"{name}, {WRITTEN}", f"{site}{path}", pid, each, sent)
                found[f"{name}, {WRITTEN}"]["results_per_second"] = round(len(took) / (time.perf_counter() - began), 1)
    for figures in found.values():
        of_bare = found[f"{BARE}, {figures['rate']} a second"]
        figures["ratio"] = round(figures["processor_ms"] / max(of_bare["processor_ms"], 0.01), 1)
    options = {"rate": rate, "racers_rate": racers_rate, "writes": writes, "entries": entries, "seconds": seconds}
    return {"database": connection.vendor, **options, "pages": found, "cores": len(os.sched_getaffinity(0))}


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    return [
        f"{name}: {page['per_second']} of {page['rate']} a second, p95 {page['p95_ms']} ms, {page['failed']} failed"
        for name, page in figures["pages"].items()
        if page["p95_ms"] > P95_MS or page["failed"] or page["per_second"] < ACHIEVED * page["rate"]
    ]


_COLUMNS = {
    "rate": "asked",
    "per_second": "a second",
    "p50_ms": "p50",
    "p95_ms": "p95",
    "p99_ms": "p99",
    "failed": "failed",
    "processor_ms": "processor",
    "ratio": "times",
    "results_per_second": "results/s",
    "load": "load",
}


def table(figures: dict[str, Any]) -> str:
    """The figures for a reader."""
    lines = [
        f"{figures['database']}, {figures['entries']:,} on the board, {figures['cores']} cores. Milliseconds;",
        "processor: of the web server, for a request, and times the bare view's.",
        f"{'':36}" + "".join(f"{title:>10}" for title in _COLUMNS.values()),
    ]
    for name, page in figures["pages"].items():
        lines.append(f"{name:36}" + "".join(f"{page.get(key, ''):>10}" for key in _COLUMNS))
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """All pages as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("spectators", "What a site answers while many watch a race.")
    parser.add_argument("--rate", type=int, default=RATE, help="requests of guests a second")
    parser.add_argument("--racers-rate", type=int, default=RACERS_RATE, help="requests of signed-in racers a second")
    parser.add_argument("--writes", type=int, default=WRITES, help="results committed a second, where there are any")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--entries", type=int, default=ENTRIES, help="racers on the board")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server of its own")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.rate, options.seconds, options.entries, options.writes, options.racers_rate)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
