"""``python -m benchmarks.spectators [--json]``: many who ask for the same pages of a running site.

Home, the races and a board of a thousand, asked for ``--rate`` times a second by guests, while nobody writes and while
the database is written to; the board by racers who are signed in; and beside them, in the same run, a Django view that
does nothing from the same web server. Milliseconds from when a request was due, so that a server that falls behind
cannot hide it. The site has a database and a folder of its own (``--postgres``: on a PostgreSQL server of its own).
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
from .load import BARE, server
from .report import command, report

RATE, SECONDS, READERS = 500, 6.0, 50
RACERS_RATE = 50
WRITES = 10
ENTRIES = 1_000
P95_MS = 100.0  # what is promised
QUIET, WRITTEN = "nobody writes", "somebody writes"


async def _ask(address: str, rate: int, seconds: float, cookies: Sequence[str]) -> dict[str, float]:
    """Ask ``rate`` times a second, in turns over ``READERS`` connections; each sends one of ``cookies``, if any."""
    where = urlsplit(address)
    took: list[float] = []
    failed = 0
    start = time.perf_counter() + 0.5

    async def reader(number: int) -> None:
        nonlocal failed
        incoming, outgoing = await asyncio.open_connection(where.hostname, where.port)
        cookie = f"Cookie: {cookies[number % len(cookies)]}\r\n" if cookies else ""
        request = f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\n{cookie}\r\n".encode()
        for turn in range(int(rate * seconds / READERS)):
            due = start + (turn * READERS + number) / rate
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            outgoing.write(request)
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


@contextmanager
def _written_to(race: Any, per_second: int) -> Iterator[None]:
    """Commit ``per_second`` times a second to the race meanwhile."""
    from django.db import connection

    from races.models import Race

    done = threading.Event()

    def write() -> None:
        turn = 0
        while not done.wait(1.0 / per_second):
            turn += 1
            Race.objects.filter(pk=race.pk).update(description=f"Note {turn}")
        connection.close()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield
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
    """``per_second`` answered, ``failed``, ``p50_ms``, ``p95_ms`` and ``p99_ms`` of the bare view and of each page;
    ``ratio``: its p95 by the bare view's. Django is set up on an empty database.

    Raises LoadError where a server does not start.
    """
    from django.db import connection
    from django.utils import timezone

    now = timezone.now()
    with counted_at_the_end():
        make_racers(entries, now)
        race = make_race("board", oval(), now)
        fill(race, entries, now)
    cookies, board = _cookies(READERS), race.get_absolute_url()
    found: dict[str, Any] = {}

    def ask(name: str, address: str, each: int, sent: Sequence[str] = ()) -> None:
        asyncio.run(_ask(address, READERS, 1.0, sent))
        found[name] = asyncio.run(_ask(address, each, seconds, sent))

    with server("benchmarks.bare", 2) as (bare, _):
        ask(BARE, f"{bare}/", rate)
    with server("config.wsgi", 2) as (site, _):
        for path in ("/", "/races/", board):
            ask(f"guests, {path}, {QUIET}", f"{site}{path}", rate)
            with _written_to(race, writes):
                ask(f"guests, {path}, {WRITTEN}", f"{site}{path}", rate)
        ask(f"racers, {board}, {QUIET}", f"{site}{board}", racers_rate, cookies)
        with _written_to(race, writes):
            ask(f"racers, {board}, {WRITTEN}", f"{site}{board}", racers_rate, cookies)
    for figures in found.values():
        figures["ratio"] = round(figures["p95_ms"] / found[BARE]["p95_ms"], 1)
    options = {"rate": rate, "racers_rate": racers_rate, "writes": writes, "entries": entries, "seconds": seconds}
    load = os.getloadavg()[0]
    return {
        "database": connection.vendor,
        **options,
        "pages": found,
        "cores": len(os.sched_getaffinity(0)),
        "load": load,
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    return [
        f"{name}: p95 {page['p95_ms']} ms, {page['failed']} failed"
        for name, page in figures["pages"].items()
        if page["p95_ms"] > P95_MS or page["failed"]
    ]


def table(figures: dict[str, Any]) -> str:
    """The figures for a reader."""
    lines = [f"{'':40}  a second     p50     p95     p99   failed"]
    for name, page in figures["pages"].items():
        times = "".join(f"{page[key]:8.1f}" for key in ("p50_ms", "p95_ms", "p99_ms"))
        lines.append(f"{name:40}  {page['per_second']:8} {times} {page['failed']:8}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """All pages as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("spectators", "What a site answers while many watch a race.")
    parser.add_argument("--rate", type=int, default=RATE, help="requests of guests a second")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--entries", type=int, default=ENTRIES, help="racers on the board")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server of its own")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.rate, options.seconds, options.entries)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
