"""``python -m benchmarks.panels [--json] [--panels N]``: what it costs that many have opened "What the car sees".

The whole site on a data folder of its own, and a live run that is played. ``--panels`` guests follow it as its page
does: for some seconds without the panel, then with it on the stream, then asking for each half second of frames, as
pages do where there is no stream. Told is the processor's time of all processes of the site.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from .live import CHUNK_S, _show, _site
from .report import command, report
from .site import SiteError
from .streams import _ENV, _Guest

PANELS, SECONDS = 100, 12.0
STARTS_S = 13.0  # the countdown, and the first chunks
WAYS = ("without", "on the stream", "asking")
TICKS = os.sysconf("SC_CLK_TCK")


class _Watcher(_Guest):
    """One open page. ``strips``: how often it was given frames."""

    strips = 0

    def _take(self, sent: bytes) -> str:
        self.strips += sent.count(b'"png"')
        return "" if b'data: {"to":' in sent else super()._take(sent)

    async def ask(self, path: str, slot: int, starts: float) -> None:
        """Each half second once it has passed, on one connection, as a browser does."""
        incoming, outgoing = await asyncio.open_connection(self._host, self._port)
        while True:
            n = int((time.time() - starts) // CHUNK_S) - 1
            outgoing.write(b"GET %s?slot=%d&n=%d HTTP/1.1\r\n" % (path.encode(), slot, n))
            outgoing.write(b"Host: %s:%d\r\n\r\n" % (self._host.encode(), self._port))
            head = await incoming.readuntil(b"\r\n\r\n")
            sizes = [line.split(b":")[1] for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
            await incoming.readexactly(int(sizes[0]) if sizes else 0)
            self.strips += b" 200 " in head.split(b"\r\n", 1)[0]
            await asyncio.sleep(max(0.0, starts + (n + 2) * CHUNK_S + 0.05 - time.time()))


def _panels(site: str, race: int, slot: int, starts: float, count: int, ways: Any) -> None:
    """A process of all who watch; it takes the name of a way, and tells how many strips each was given by it."""

    async def watched(way: str) -> float:
        topic = f"live:{race}&of=sees:{race}" if way == "on the stream" else f"live:{race}"
        watching = [_Watcher(site, "", topic) for _ in range(count)]
        tasks = [asyncio.create_task(one.look()) for one in watching]
        if way == "asking":
            tasks += [
                asyncio.create_task(one.ask("/races/race-night/event/frames.png", slot, starts)) for one in watching
            ]
        await asyncio.sleep(3.0)
        before = sum(one.strips for one in watching)
        ways.send("begun")
        await asyncio.get_running_loop().run_in_executor(None, ways.recv)
        for task in tasks:
            task.cancel()
        return (sum(one.strips for one in watching) - before) / count

    while way := ways.recv():
        ways.send(asyncio.run(watched(way)))


def _used(root: int) -> float:
    """Seconds of the processor that a process and all below it have taken, with those of them that have ended."""
    told: dict[int, tuple[int, int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(") ")[2].split()
        except OSError:
            continue
        told[int(stat.parent.name)] = int(fields[1]), sum(int(each) for each in fields[11:15])
    family = {root}
    while more := {pid for pid, (parent, _) in told.items() if parent in family} - family:
        family |= more
    return sum(told[pid][1] for pid in family if pid in told) / TICKS


def measure(panels: int = PANELS, seconds: float = SECONDS) -> dict[str, Any]:
    """See the module. Raises SiteError."""
    with tempfile.TemporaryDirectory(prefix="pb-") as folder, _site(Path(folder)) as site:
        os.environ |= _ENV | {"PADDOCK_DATA": str(Path(folder) / "state")}
        import django

        django.setup()
        from django.utils import timezone

        from races.live.services import launch
        from races.models import LiveSlot, SlotState

        event, alice, _quiet = _show(STARTS_S + len(WAYS) * (seconds + 8.0))
        slot = launch(event=event, by=alice, seen=None, now=timezone.now())
        assert slot.starts_at is not None
        root = _runs(site)
        here, there = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        given = (site, event.race_id, slot.pk, slot.starts_at.timestamp(), panels, there)
        process = context.Process(target=_panels, args=given)
        process.start()
        time.sleep(STARTS_S)
        found: dict[str, Any] = {"panels": panels, "cores": len(os.sched_getaffinity(0))}
        for way in WAYS:
            here.send(way)
            assert here.recv() == "begun"
            before, since = _used(root), time.monotonic()
            time.sleep(seconds)
            took = time.monotonic() - since
            share = (_used(root) - before) / took
            here.send("over")
            found[way] = {"share_of_a_core": round(share, 3), "strips_a_second": round(here.recv() / took, 2)}
        here.send("")
        process.join(30)
        if LiveSlot.objects.get(pk=slot.pk).state != SlotState.RUNNING:
            raise SiteError("the run was over too soon")
    rest = found["without"]["share_of_a_core"]
    for way in WAYS[1:]:
        found[way]["of_500_panels"] = round(max(0.0, found[way]["share_of_a_core"] - rest) * 500 / panels, 3)
    return found


def _runs(site: str) -> int:
    """The process that runs the site of this address. Raises SiteError."""
    port = site.rpartition(":")[2].encode()
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = line.read_bytes().split(b"\0")
        except OSError:
            continue
        if b"manage.py" in words and b"run" in words and port in words:
            return int(line.parent.name)
    raise SiteError("the site's process is not found")


def table(figures: dict[str, Any]) -> str:
    """One line for each way."""
    lines = [f"{figures['panels']} panels, {figures['cores']} cores: share of a core of the whole site"]
    for way in WAYS:
        told = figures[way]
        more = f", so 500 panels take {told['of_500_panels']:.3f} more" if "of_500_panels" in told else ""
        lines.append(f"{way:>14}: {told['share_of_a_core']:.3f} ({told['strips_a_second']} strips a second each){more}")
    return "\n".join(lines)


def misses(figures: dict[str, Any]) -> list[str]:
    """Who follows the stream is given two strips a second, for a tenth of what asking takes at most."""
    stream, asking = figures["on the stream"], figures["asking"]
    missed = []
    if stream["strips_a_second"] < 1.8:
        missed.append(f"two strips a second come by the stream: {stream}")
    if stream["of_500_panels"] > asking["of_500_panels"] / 10:
        missed.append(f"the stream takes a tenth of what asking takes: {stream} {asking}")
    return missed


def main(arguments: list[str] | None = None) -> int:
    """The figures as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("panels", "What it costs that many have opened what the car sees.")
    parser.add_argument("--panels", type=int, default=PANELS)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each way")
    options = parser.parse_args(arguments)
    figures = measure(options.panels, options.seconds)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
