"""``python -m benchmarks.live [--json] [--quick]``: many who watch a live run, beside racing.

The whole site (``manage.py run``) on a data folder of its own. ``--spectators`` guests follow one live event through
the web server's port, as its page does: they measure the server's clock, take what the stream tells, and when something
moved ask for the page, conditionally, spread over the time that the stream names. One in ten comes in the middle of the
run. Meanwhile a worker drives car after car, and the organiser says something now and then.

Told are: how far apart spectators have the same pose and show the same moment, what was lost by its number, how long
after a commit they had its message and its page, what a quiet event is sent, and what the stream process took.
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import os
import queue
import random
import re
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .report import command, report
from .site import SiteError, _running_site
from .streams import _ENV, IDLE, IDLE_BYTES, P95_MS, _Guest, _health, _racing, _shares, table

SPECTATORS, SECONDS, SAYS_EVERY_S = 500, 60, 4.0
QUICK = {"spectators": 60, "seconds": 15}
SETTLES_S, COUNTDOWN_S, REVEALED_S = 5.0, 10.0, 30.0
SPREAD_MS = 500.0  # what is promised
CHUNK_S, BEHIND_S = 0.5, 1.5
_MESSAGE, _SLOT = re.compile(rb'"message":"([^"]*)"'), re.compile(rb'"poses":{"slot":(\d+)')
_CHUNK = re.compile(rb'"n":(\d+),"cars"')


class _Spectator(_Guest):
    """One open page of a live event."""

    def __init__(self, site: str, path: str, topic: str) -> None:
        super().__init__(site, path, topic)
        where = urlsplit(site)
        self._clock_of = where.hostname or "127.0.0.1", where.port or 80
        self._shortest = 10.0
        self._starts = asyncio.Event()
        self.offset_s: float | None = None  # of the server's clock against time.monotonic
        self.chunks: dict[tuple[int, int], float] = {}  # when, by slot and number
        self.welcomed: dict[int, int] = {}  # from which chunk on, by slot
        self.over: dict[int, float] = {}
        self.heard: dict[str, float] = {}  # when, by what the organiser said

    async def watch(self, after_s: float = 0.0) -> None:
        await asyncio.sleep(after_s)
        following = asyncio.create_task(self.look())
        await self._measure()
        await self._starts.wait()
        await asyncio.sleep(5.0 * random.random())
        await self._measure()
        await following

    async def _measure(self) -> None:
        """Three round trips, as a page measures the clock when it is opened and when a run is about to start."""
        for _ in range(3):
            try:
                sent = time.monotonic()
                incoming, outgoing = await asyncio.open_connection(*self._clock_of)
                outgoing.write(b"GET /stream/clock HTTP/1.1\r\nHost: %s\r\n\r\n" % self._clock_of[0].encode())
                answer = await incoming.read()
                received = time.monotonic()
                outgoing.close()
                now = json.loads(answer[answer.index(b"{") : answer.index(b"}") + 1])["now"] / 1000
            except (OSError, ValueError, LookupError):
                self.fails += 1
                continue
            if received - sent < self._shortest:
                self._shortest, self.offset_s = received - sent, now - (sent + received) / 2
            await asyncio.sleep(0.3 + 0.7 * random.random())

    def _take(self, sent: bytes) -> str:
        if b'data: {"to":' not in sent:
            return super()._take(sent)
        now, rest = time.monotonic(), []
        for message in sent.split(b"\n\n"):
            if b'data: {"to":' in message:
                self._hear(message, now)
            elif message:
                rest.append(message)
        return super()._take(b"\n\n".join([*rest, b""])) if rest else ""

    def _hear(self, message: bytes, now: float) -> None:
        """Read without parsing: it is hundreds of times what a page does, on the same processors."""
        if state := _MESSAGE.search(message):
            self.heard.setdefault(state[1].decode(), now)
            if b'"current":{' in message:
                self._starts.set()
        if poses := _SLOT.search(message):
            slot, numbers = int(poses[1]), [int(n) for n in _CHUNK.findall(message)]
            if numbers:
                self.welcomed.setdefault(slot, numbers[0])
            for n in numbers:
                self.chunks.setdefault((slot, n), now)
            if b'"over":true' in message:
                self.over.setdefault(slot, now)


def _spectators(site: str, path: str, topics: tuple[str, str], count: int, late_s: float, events: Any) -> None:
    """A process of all spectators; it tells what they saw. ``events``: ready, begun, over; and a queue for it."""
    ready, begun, over, found = events

    async def all_of_them() -> None:
        watching = [_Spectator(site, path, topics[0]) for _ in range(count)]
        idle = [_Guest(site, "", topics[1]) for _ in range(IDLE)]
        late = watching[::10]
        tasks = []
        for one in (*(each for each in watching if each not in late), *idle):
            tasks.append(asyncio.create_task(one.watch() if isinstance(one, _Spectator) else one.look()))
            await asyncio.sleep(0.01)
        await asyncio.sleep(SETTLES_S)
        since, before = time.monotonic(), sum(guest.bytes for guest in idle)
        ready.set()
        while not begun.is_set():
            await asyncio.sleep(0.05)
        used = resource.getrusage(resource.RUSAGE_SELF)
        begun_s = used.ru_utime + used.ru_stime
        bytes_before, playing = sum(one.bytes for one in watching if one not in late), time.monotonic()
        tasks += [asyncio.create_task(one.watch(COUNTDOWN_S + late_s + 2 * random.random())) for one in late]
        while not over.is_set():
            await asyncio.sleep(0.2)
        minutes = (time.monotonic() - playing) / 60
        used = resource.getrusage(resource.RUSAGE_SELF)
        sent = sum(one.bytes for one in watching if one not in late) - bytes_before
        idle_bytes = (sum(one.bytes for one in idle) - before) / IDLE / ((time.monotonic() - since) / 60)
        for task in tasks:
            task.cancel()
        found.put(
            {
                "spectators": [
                    {
                        "chunks": one.chunks,
                        "from": one.welcomed,
                        "over": one.over,
                        "heard": one.heard,
                        "shown": one.shown,
                        "offset_s": one.offset_s,
                        "late": one in late,
                    }
                    for one in watching
                ],
                "asked": sum(one.asked for one in watching),
                "unchanged": sum(one.unchanged for one in watching),
                "fails": sum(one.fails for one in watching),
                "idle_bytes": idle_bytes,
                "share": (used.ru_utime + used.ru_stime - begun_s) / 60 / minutes,
                "bytes": sent / max(1, count - len(late)) / minutes,
            }
        )

    asyncio.run(all_of_them())


def _show(seconds: float) -> tuple[Any, Any, Any]:
    """A live event under way with a run of so many seconds, computed and sealed; its organiser; and a quiet one."""
    from django.db import transaction
    from django.utils import timezone

    from core.wakeups import workers as wakeup
    from evaluation.models import Evaluation
    from evaluation.running.queue.jobs import finish_evaluation
    from races.models import LiveSlot
    from tests.evaluation.stubs import HEADER
    from tests.factories import a_racer, lap, outcome, start
    from tests.live_shows import a_live_race, a_show, begun

    now, alice = timezone.now(), a_racer("alice")
    ringing, wakeup.publish = wakeup.publish, lambda *_, **__: None  # these are no cars that could drive
    names = [f"racer{number}" for number in range(20)]
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    lap_ms = 7_300
    steps, centre = round(seconds * 15), race.track.geometry.centre
    rows = []
    for step in range(steps):
        x, y = centre[round(step * 1000 / 15) % lap_ms * len(centre) // lap_ms]
        where = f"{step * 1000 // 15 // lap_ms},{step},{x:.4f},{y:.4f},0.0,12.0,1.5,1,0.0,False,True,1.0,1,20.0"
        rows.append(f"{where},{step / 15},in_progress,0,0,0.0")
    laps = [
        {**lap(number, lap_ms), "start_ms": lap_ms * (number - 1)}
        for number in range(1, round(seconds * 1000) // lap_ms + 1)
    ]
    told = replace(outcome(laps), trace_csv="\n".join([HEADER, *rows, ""]).encode())
    with transaction.atomic():  # no worker of the site sees them before they are computed
        event = begun(a_show(now, alice, names, race=race, order="as_entered"), alice, now)
        for slot in LiveSlot.objects.filter(event=event, evaluation__sealed=True):
            assert slot.evaluation_id is not None
            run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id), timezone.now())
            assert run.lease is not None
            if not finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=timezone.now()):
                raise SiteError("a worker of the site took a run that is to be shown")
    quiet = a_show(now, alice, [], race=a_live_race(now, alice, name="Quiet", slug="quiet"))
    wakeup.publish = ringing
    return event, alice, quiet


@contextmanager
def _site(folder: Path) -> Iterator[str]:
    if ready := os.environ.get("BENCH_SITE"):
        shutil.copytree(ready, folder / "state")
    with _running_site(folder) as url:
        yield url


def measure(spectators: int = SPECTATORS, seconds: float = SECONDS) -> dict[str, Any]:
    """See the module. ``BENCH_SITE`` in the environment: a data folder to begin with a copy of. Raises SiteError."""
    with tempfile.TemporaryDirectory(prefix="pb-") as folder, _site(Path(folder)) as site:
        os.environ |= _ENV | {"PADDOCK_DATA": str(Path(folder) / "state")}
        import django

        django.setup()
        from django.db import transaction
        from django.utils import timezone

        from core.events.models import Event
        from races.live.services import launch, set_message
        from races.models import LiveSlot, SlotState

        event, alice, quiet = _show(seconds)
        context = multiprocessing.get_context("spawn")
        ready, begun, over = context.Event(), context.Event(), context.Event()
        found = context.Queue()
        topics = f"live:{event.race_id}", f"live:{quiet.race_id}"
        path = f"{event.race.get_absolute_url()}event/"
        process = context.Process(
            target=_spectators, args=(site, path, topics, spectators, seconds / 2, (ready, begun, over, found))
        )
        process.start()
        done: dict[str, int] = {}
        committed: dict[int, float] = {}
        said: dict[str, float] = {}
        try:
            with _racing(done):
                if not ready.wait(240):
                    raise SiteError("the spectators do not come")
                before, since, load = _health(site), time.monotonic(), os.getloadavg()[0]
                slot = launch(event=event, by=alice, seen=None, now=timezone.now())
                begun.set()
                assert slot.starts_at is not None
                starts = time.monotonic() + (slot.starts_at - timezone.now()).total_seconds()
                most = before["streams"]
                while not LiveSlot.objects.filter(pk=slot.pk, state=SlotState.DONE).exists():
                    if time.monotonic() > starts + seconds + REVEALED_S:
                        raise SiteError("the run was not revealed")
                    turn = time.monotonic()
                    if turn < starts + seconds:
                        words = f"Message {len(said)}"
                        moments: list[float] = []
                        with transaction.atomic():
                            transaction.on_commit(partial(_note, moments))
                            set_message(event=event, message=words, by=alice, seen=None, now=timezone.now())
                        said[words] = moments[0]
                        newest = Event.objects.filter(kind="live.changed", race=event.race_id).latest("pk")
                        committed[newest.pk] = moments[0]
                    most = max(most, _health(site)["streams"])
                    time.sleep(max(0.2, turn + SAYS_EVERY_S * random.uniform(0.7, 1.3) - time.monotonic()))
                time.sleep(SETTLES_S)
                after, took = _health(site), time.monotonic() - since
                loads = [round(load, 1), round(os.getloadavg()[0], 1)]
            over.set()
            seen = found.get(timeout=120)
        except queue.Empty:
            raise SiteError("the spectators do not tell what they saw") from None
        finally:
            over.set()
            process.join(30)
            if process.is_alive():
                process.kill()
        numbers = dict(Event.objects.filter(pk__in=committed).values_list("pk", "position"))
    watching = seen["spectators"]
    chunks = _of_poses(watching, slot.pk, starts, time.time() - time.monotonic())
    at = {numbers[pk]: moment for pk, moment in committed.items()}
    told = sorted(
        (one["heard"][words] - at_) * 1000 for one in watching for words, at_ in said.items() if words in one["heard"]
    )
    shown = sorted((one["shown"][n] - at[n]) * 1000 for one in watching for n in at if n in one["shown"])
    there = [one for one in watching if not one["late"]]
    return {
        "spectators": spectators,
        "open": most,
        "run_seconds": seconds,
        "seconds": round(took, 1),
        "runs_meanwhile": done["runs"],
        **chunks,
        "lost_ends": sum(slot.pk not in one["over"] for one in watching),
        "lost_messages": sum(words not in one["heard"] for one in there for words in said),
        "broken": seen["fails"],
        "messages": len(said),
        "told_ms": _shares(told),
        "page_ms": _shares(shown),
        "pages_asked": seen["asked"],
        "pages_unchanged": seen["unchanged"],
        "bytes_per_minute": round(seen["bytes"]),
        "idle_bytes_per_minute": round(seen["idle_bytes"]),
        "memory_mb": after["memory_mb"],
        "memory_before_mb": before["memory_mb"],
        "processor_share": round((after["processor_s"] - before["processor_s"]) / took, 3),
        "spectators_processor_share": round(seen["share"], 3),
        "cores": len(os.sched_getaffinity(0)),
        "load": loads,
    }


def _note(moments: list[float]) -> None:
    moments.append(time.monotonic())


def _of_poses(watching: list[dict[str, Any]], slot: int, starts: float, wall_s: float) -> dict[str, Any]:
    """What became of the poses of a run that started at ``starts``. ``wall_s``: the wall's clock over the monotonic.

    ``early``: chunks that somebody had before they had passed; ``have_spread_ms``: from the first to the last who has
    the same half second, of those who were there; ``show_spread_ms``: from the first to the last who shows it: a page
    shows it a second and a half after its time by the clock that it measured, or when it has it, if that is later.
    """
    there = [one for one in watching if not one["late"]]
    last = max((n for one in watching for of, n in one["chunks"] if of == slot), default=-1)
    have, show, after, lost, early, waited = [], [], [], 0, 0, 0
    offsets = [one["offset_s"] - wall_s for one in watching if one["offset_s"] is not None]
    for n in range(last + 1):
        passed, due = starts + (n + 1) * CHUNK_S, starts + n * CHUNK_S + BEHIND_S
        came, begins = [], []
        for one in watching:
            moment = one["chunks"].get((slot, n))
            if moment is None:
                lost += n >= one["from"].get(slot, 0)
                continue
            early += moment < passed - 0.002  # the two processes' clocks are the same
            due_here = due - (one["offset_s"] - wall_s if one["offset_s"] is not None else 0.0)
            if not one["late"]:
                came.append(moment)
                after.append((moment - passed) * 1000)
                waited += moment > due_here
            if moment <= due_here or not one["late"]:
                begins.append(max(moment, due_here))
        if came:
            have.append((max(came) - min(came)) * 1000)
        if begins:
            show.append((max(begins) - min(begins)) * 1000)
    return {
        "chunks": last + 1,
        "lost": lost,
        "early": early,
        "late_comers": len(watching) - len(there),
        "after_its_time_ms": _shares(sorted(after)),
        "have_spread_ms": _shares(sorted(have)) | {"most": round(max(have, default=0.0), 1)},
        "show_spread_ms": _shares(sorted(show)) | {"most": round(max(show, default=0.0), 1)},
        "waited_for_poses": waited,
        "clock_off_ms": round(1000 * max((abs(one) for one in offsets), default=0.0), 1),
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    missed = []
    if figures["told_ms"].get("p95", P95_MS + 1) > P95_MS:
        missed.append(f"95 of 100 are told within {P95_MS:.0f} ms: {figures['told_ms']}")
    if not figures["chunks"] or figures["show_spread_ms"]["most"] > SPREAD_MS:
        missed.append(f"all show the same moment within {SPREAD_MS:.0f} ms: {figures['show_spread_ms']}")
    for what in ("lost", "early", "lost_ends", "lost_messages"):
        if figures[what]:
            missed.append(f"{figures[what]} {what.replace('_', ' ')}")
    if figures["idle_bytes_per_minute"] > IDLE_BYTES:
        missed.append(f"a quiet event is sent {figures['idle_bytes_per_minute']} bytes a minute")
    return missed


def main(arguments: list[str] | None = None) -> int:
    """The figures as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("live", "Whether many watch a live run at the same instant, and what that costs.")
    parser.add_argument("--spectators", type=int)
    parser.add_argument("--seconds", type=float, help="that the run lasts")
    parser.add_argument("--quick", action="store_true", help="sixty spectators of a run of fifteen seconds")
    options = parser.parse_args(arguments)
    asked = {name: value for name in QUICK if (value := getattr(options, name)) is not None}
    figures = measure(**((QUICK if options.quick else {}) | asked))
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
