"""``python -m benchmarks.streams [--signed-in] [--json]``: many open pages of a running site, beside racing.

The whole site (``manage.py run``) on a data folder of its own. ``--streams`` guests look at one race through the web
server's port, or so many racers, each with a session and their own topic beside the race's. Its board moves ``--rate``
times a second, while a worker drives car after car. Each guest does as a page does: reads the stream, and when the
race moved asks for the page, conditionally, spread over the time that the stream names. Milliseconds from the commit
to what a guest's stream was told and to the page; events that a guest was not told of, by their numbers; memory and
processor of the stream process; and what is sent where nothing happens.
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import os
import random
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .report import command, report
from .site import _running_site

STREAMS, SECONDS, RATE = 500, 600.0, 1.0
IDLE = 5
SETTLES_S = 5.0
P95_MS, IDLE_BYTES = 500.0, 2000  # what is promised
_ENV = {"DJANGO_SETTINGS_MODULE": "config.settings", "OMP_NUM_THREADS": "1"}


class _Guest:
    """One open page."""

    def __init__(self, site: str, path: str, topic: str, session: str = "") -> None:
        where = urlsplit(site)
        self._host, self._port = where.hostname or "127.0.0.1", where.port or 80
        self._path, self._topic = path, f"{topic}&of=me" if session else topic
        self._cookie = f"Cookie: {session}\r\n" if session else ""
        self.told: dict[int, float] = {}  # when, by the number of the event
        self.shown: dict[int, float] = {}
        self.bytes = 0
        self.fails = 0
        self.asked = self.unchanged = 0
        self._spread = 0.0
        self._shows: asyncio.Task[None] | None = None
        self._waits: list[int] = []
        self._tag = b""
        self._last_at = 0.0

    async def look(self) -> None:
        """Until cancelled; a stream that ends is opened again with the last number."""
        last = ""
        while True:
            incoming, outgoing = await asyncio.open_connection(self._host, self._port)
            header = self._cookie + (f"Last-Event-ID: {last}\r\n" if last else "")
            request = f"GET /stream/?of={self._topic} HTTP/1.1\r\nHost: {self._host}:{self._port}\r\n{header}\r\n"
            outgoing.write(request.encode())
            try:
                if b" 200 " not in await incoming.readuntil(b"\r\n\r\n"):
                    raise ConnectionError
                while size := int(await incoming.readuntil(b"\r\n"), 16):
                    last = self._take(await incoming.readexactly(size + 2)) or last
                    self.bytes += size + 2
            except (ConnectionError, asyncio.IncompleteReadError):
                self.fails += 1
                await asyncio.sleep(1.0)
            finally:
                outgoing.close()

    def _take(self, sent: bytes) -> str:
        now, last, event = time.monotonic(), "", ""
        for line in sent.decode().split("\n"):
            name, _, value = line.partition(": ")
            if name == "id":
                last = value
            elif name == "event":
                event = value
            elif name == "data":
                told = json.loads(value)
                self._spread = told.get("spread", self._spread * 1000) / 1000
                for number in () if event else told.get("at", ()):
                    self.told.setdefault(number, now)
                    self._waits.append(number)
            elif not name:
                event = ""
        if self._waits and self._path and (self._shows is None or self._shows.done()):
            self._shows = asyncio.create_task(self._show())
        return last

    async def _show(self) -> None:
        gap = max(0.0, self._last_at + max(1.0, 2 * self._spread) - time.monotonic())
        await asyncio.sleep(gap + random.random() * self._spread)
        while self._waits:
            waited, self._waits = self._waits, []
            self._last_at = time.monotonic()
            try:
                await self._page(waited)
            except (OSError, ValueError, asyncio.IncompleteReadError):
                self.fails += 1
                continue
            for number in waited:
                self.shown.setdefault(number, time.monotonic())
            if self._waits:
                await asyncio.sleep(max(1.0, 2 * self._spread) + random.random() * self._spread)

    async def _page(self, waited: list[int]) -> None:
        incoming, outgoing = await asyncio.open_connection(self._host, self._port)
        try:
            lines = [b"GET %s HTTP/1.1" % self._path.encode(), b"Host: %s:%d" % (self._host.encode(), self._port)]
            lines += [b"X-Paddock-Parts: 1", b"Accept-Encoding: gzip", b"Connection: close"]
            lines.append(b"X-Paddock-At: %d" % max(waited))
            lines += [self._cookie.strip().encode()] if self._cookie else []
            if self._tag:
                lines.append(b"If-None-Match: " + self._tag)
            outgoing.write(b"\r\n".join([*lines, b"", b""]))
            head = await incoming.readuntil(b"\r\n\r\n")
            await incoming.read()
            self.asked += 1
            self.unchanged += b" 304 " in head.split(b"\r\n", 1)[0]
            tags = [line[6:] for line in head.split(b"\r\n") if line[:6].lower() == b"etag: "]
            self._tag = tags[0] if tags else b""
        finally:
            outgoing.close()


def _guests(site: str, path: str, topic: str, sessions: list[str], ready: Any, over: Any, found: Any) -> None:
    """A process of all guests; it tells what they saw. ``sessions``: the cookie of each, empty without one."""

    async def all_of_them() -> list[_Guest]:
        looking = [_Guest(site, path, topic, session) for session in sessions]
        idle = [_Guest(site, "", "season:0") for _ in range(IDLE)]
        tasks = []
        for guest in (*looking, *idle):
            tasks.append(asyncio.create_task(guest.look()))
            await asyncio.sleep(0.005)
        await asyncio.sleep(SETTLES_S)
        begun, before = time.monotonic(), sum(guest.bytes for guest in idle)
        ready.set()
        while not over.is_set():
            await asyncio.sleep(0.2)
        idle_bytes = (sum(guest.bytes for guest in idle) - before) / IDLE / ((time.monotonic() - begun) / 60)
        for task in tasks:
            task.cancel()
        found.put(
            {
                "told": [guest.told for guest in looking],
                "shown": [guest.shown for guest in looking],
                "asked": sum(guest.asked for guest in looking),
                "unchanged": sum(guest.unchanged for guest in looking),
                "fails": sum(guest.fails for guest in looking),
                "idle_bytes": idle_bytes,
            }
        )
        return looking

    asyncio.run(all_of_them())


@contextmanager
def _racing(done: dict[str, int]) -> Iterator[None]:
    """A worker drives one car after the other meanwhile."""
    from django.db import connection
    from django.utils import timezone

    from evaluation.models import Evaluation, State, TrainedModel
    from evaluation.running.queue.services import queue_evaluation
    from paddock.rules.race import RaceRules
    from tracks.models import Track

    over = threading.Event()
    models = TrainedModel.objects.filter(owner__is_house=True, deleted_at=None)
    until = time.monotonic() + 60
    while not models.exists() and time.monotonic() < until:  # a worker brings them at its start
        time.sleep(0.5)
    model, track = models.select_related("owner").first(), Track.objects.get(slug="oval")

    def drive() -> None:
        while model is not None and not over.wait(0.2):
            if not Evaluation.objects.filter(owner=model.owner, state__in=(State.QUEUED, State.RUNNING)).exists():
                queue_evaluation(
                    owner=model.owner, model=model, track=track, rules=RaceRules(), checked=True, now=timezone.now()
                )
        connection.close()

    thread = threading.Thread(target=drive)
    before = Evaluation.objects.filter(state=State.FINISHED).count()
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        done["runs"] = Evaluation.objects.filter(state=State.FINISHED).count() - before


def _note(moments: list[float]) -> None:
    moments.append(time.monotonic())


def _health(site: str) -> dict[str, Any]:
    with urllib.request.urlopen(f"{site}/stream/health", timeout=10) as answer:
        return json.loads(answer.read())


def _sessions(count: int, now: Any) -> list[str]:
    """The cookies of so many racers who have logged in."""
    from django.conf import settings
    from django.test import Client

    from accounts.models import Racer

    from .board_rows import make_racers

    make_racers(count, now)
    cookies = []
    for racer in Racer.objects.filter(is_house=False).order_by("pk")[:count]:
        client = Client()
        client.force_login(racer, backend=settings.AUTHENTICATION_BACKENDS[0])
        cookies.append(f"{settings.SESSION_COOKIE_NAME}={client.cookies[settings.SESSION_COOKIE_NAME].value}")
    return cookies


def measure(
    streams: int = STREAMS, seconds: float = SECONDS, rate: float = RATE, *, signed_in: bool = False
) -> dict[str, Any]:
    """See the module; ``lost``: events by guests that were not told of them. Raises SiteError."""
    state = tempfile.TemporaryDirectory(prefix="pb-", ignore_cleanup_errors=True)
    with state as folder, _running_site(Path(folder)) as site:
        os.environ |= _ENV | {"PADDOCK_DATA": str(Path(folder) / "state")}
        import django

        django.setup()
        from django.db import transaction
        from django.utils import timezone

        from core.events.models import Event
        from races.events import record_board
        from tests.factories import a_race, a_racer, drive, laps

        now = timezone.now()
        race = a_race(now, slug="final", name="Final")
        from core.wakeups import workers as wakeup

        ringing, wakeup.publish = wakeup.publish, lambda *_, **__: None  # these are no cars that could drive
        with transaction.atomic():  # or a worker would claim one that waits
            for place in range(20):
                drive(race, a_racer(f"racer{place}"), laps(9_000 + place, 9_100, 9_200), now)
        wakeup.publish = ringing
        sessions = _sessions(streams, now) if signed_in else [""] * streams
        context = multiprocessing.get_context("spawn")
        ready, over, found = context.Event(), context.Event(), context.Queue()
        topic = f"race:{race.pk}"
        process = context.Process(
            target=_guests, args=(site, race.get_absolute_url(), topic, sessions, ready, over, found)
        )
        process.start()
        done: dict[str, int] = {}
        committed: dict[int, float] = {}
        with _racing(done):
            ready.wait(120)
            before, begun, load = _health(site), time.monotonic(), os.getloadavg()[0]
            most_streams = before["streams"]
            while (turn := time.monotonic()) - begun < seconds:
                moments: list[float] = []
                with transaction.atomic():
                    # the first that is done after the commit, before anybody is rung for
                    transaction.on_commit(partial(_note, moments))
                    record_board(race)
                committed[Event.objects.filter(kind="race.board", race=race.pk).latest("pk").pk] = moments[0]
                most_streams = max(most_streams, _health(site)["streams"]) if len(committed) % 60 == 1 else most_streams
                time.sleep(max(0.0, turn + random.uniform(0.5, 1.5) / rate - time.monotonic()))
            time.sleep(SETTLES_S)
            after, took = _health(site), time.monotonic() - begun
        over.set()
        seen = found.get(timeout=60)
        process.join()
        numbers = dict(Event.objects.filter(pk__in=committed).values_list("pk", "position"))
    at = {numbers[pk]: moment for pk, moment in committed.items()}
    told = sorted(max(0.0, one[n] - at[n]) * 1000 for one in seen["told"] for n in at if n in one)
    shown = sorted(max(0.0, one[n] - at[n]) * 1000 for one in seen["shown"] for n in at if n in one)
    return {
        "streams": streams,
        "signed_in": signed_in,
        "open": most_streams,
        "seconds": round(took, 1),
        "events": len(at),
        "runs_meanwhile": done["runs"],
        "lost": sum(n not in one for one in seen["told"] for n in at),
        "broken": seen["fails"],
        "told_ms": _shares(told),
        "shown_ms": _shares(shown),
        "pages_asked": seen["asked"],
        "pages_unchanged": seen["unchanged"],
        "idle_bytes_per_minute": round(seen["idle_bytes"]),
        "memory_mb": after["memory_mb"],
        "memory_before_mb": before["memory_mb"],
        "processor_share": round((after["processor_s"] - before["processor_s"]) / took, 3),
        "cores": len(os.sched_getaffinity(0)),
        "load": [round(load, 1), round(os.getloadavg()[0], 1)],
    }


def _shares(sorted_ms: list[float]) -> dict[str, float]:
    if not sorted_ms:
        return {}
    return {
        f"p{part}": round(sorted_ms[min(len(sorted_ms) * part // 100, len(sorted_ms) - 1)], 1) for part in (50, 95, 99)
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    missed = []
    if figures["told_ms"].get("p95", P95_MS + 1) > P95_MS:
        missed.append(f"95 of 100 are told within {P95_MS:.0f} ms: {figures['told_ms']}")
    if figures["lost"]:
        missed.append(f"{figures['lost']} events were lost")
    if figures["idle_bytes_per_minute"] > IDLE_BYTES:
        missed.append(f"a stream that rests is sent {figures['idle_bytes_per_minute']} bytes a minute")
    return missed


def table(figures: dict[str, Any]) -> str:
    """The figures for a reader."""
    return "\n".join(f"{name.replace('_', ' '):24} {value}" for name, value in figures.items())


def main(arguments: list[str] | None = None) -> int:
    """The figures as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("streams", "What open pages of a site cost, and how soon they move.")
    parser.add_argument("--streams", type=int, default=STREAMS)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--signed-in", action="store_true", help="racers with sessions instead of guests")
    parser.add_argument("--rate", type=float, default=RATE, help="events of the race a second")
    options = parser.parse_args(arguments)
    figures = measure(options.streams, options.seconds, options.rate, signed_in=options.signed_in)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
