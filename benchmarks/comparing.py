"""``python -m benchmarks.comparing [--json]``: what it costs to compare eight runs.

Eight really driven cars, on a separate site. First one reader in Chromium (``--turns``), each time in a new
profile, on servers that have just been started and on warm ones: time to the first frame with all cars on the map, the
processor time of browser and server until then, and bytes; beside the page of the race, by the same browser in the same
run. Then ``--people`` who are signed in, each of whom opens another comparison every ``--pause`` seconds and looks at
its telemetry: latencies, and the server's processor time for each, beside a bare view's. On a busy machine read the
processor times and ratios.
"""

from __future__ import annotations

import asyncio
import gzip
import html
import json
import os
import random
import re
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit

from .board import database
from .load import BARE, processor_s, server
from .panels import _used
from .report import command, report
from .spectators import _ask

PEOPLE, PAUSE_S, ROUNDS, TURNS = 50, 10.0, 3, 5
LAPS, RUNS, TRACK = 3, 8, "reinvent-2018"
FRAME_MS, PAGE_MS = 1000.0, 1000.0  # promised on idle cores: the first frame; 19 of 20 pages and 19 of 20 documents
OF_RACE = 2.0  # at most: the browser's processor time to the first frame, by the page of the race
FIRST_KB = 160  # at most, to the first frame of a new profile
COLD, WARM, RACE = "eight runs, servers just started", "eight runs", "page of the race"
PARTS = ("page", "documents", "analysis", "telemetry")
# what the viewer says when it has painted all cars (static/viewer/viewer.js)
PAINTED = "performance.getEntriesByName('viewer:painted')[0]?.startTime ?? 0"
CONTENT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"
CARS = "document.querySelectorAll('[data-map] .replay-car').length"


def eight_runs(now: datetime) -> list[Any]:
    """Finished runs of one race by eight racers, each at another speed beside another line, the fastest first."""
    from evaluation.running.queue.jobs import finish_evaluation
    from paddock.rules.race import RaceRules
    from paddock.simulator.policies import CentreLinePilot
    from paddock.simulator.race import Entrant, RaceSettings, run_race
    from races.entries.services.submissions import submit_model
    from tests.factories import a_model, a_race, a_racer, outcome, start
    from tracks.models import Track
    from tracks.services import load_catalogue

    load_catalogue()
    track = Track.objects.get(slug=TRACK)
    race = a_race(now, slug="compared", name="Compared", track=track, laps=LAPS, minimum_laps=LAPS)
    driven = []
    for number in range(RUNS):
        pilot = CentreLinePilot(track.geometry, speed=2.2 - 0.08 * number, offset=0.02 * (number - RUNS // 2))
        entrant = Entrant(pilot.action_space, pilot.sensors, pilot)
        result = run_race(RaceSettings(track.geometry, RaceRules(laps=LAPS), [entrant]))
        racer = a_racer(f"driver-{number}")
        run = start(submit_model(race=race, racer=racer, model=a_model(racer), now=now).evaluation, now)
        assert run.lease is not None
        laps: list[dict[str, Any]] = [{**lap.to_dict()} for lap in result.laps]
        told = replace(outcome(laps), trace_csv=result.trace.to_csv())
        assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=told, now=now)
        run.refresh_from_db()
        driven.append(run)
    return driven


def comparison(runs: Sequence[Any], first: int = 0) -> str:
    """The page's address of all runs, another of them first."""
    shown, *others = [run.public_id for run in (*runs[first:], *runs[:first])]
    return f"/evaluations/{shown}/replay/?with={','.join(others)}"


def cookies(count: int) -> list[str]:
    """Sessions of ``count`` racers, as they are sent."""
    from django.conf import settings
    from django.test import Client

    from tests.factories import a_racer

    found = []
    for number in range(count):
        client = Client()
        client.force_login(a_racer(f"reader-{number}"))
        found.append(f"{settings.SESSION_COOKIE_NAME}={client.cookies[settings.SESSION_COOKIE_NAME].value}")
    return found


def in_a_browser(site: str, pid: int, pages: Sequence[tuple[str, str]]) -> dict[str, dict[str, float]]:
    """Each page in a new profile of Chromium, in this order: the least milliseconds to its first frame (``frame_ms``,
    of the race's page its first content), the least processor milliseconds until then of the browser (``browser_ms``)
    and the server (``server_ms``), and kilobytes and answers until then."""
    from playwright.sync_api import sync_playwright

    from tests.pages.browsing import CHROMIUM, FLAGS

    found: dict[str, dict[str, float]] = {}
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        root = os.getpid()
        for name, path in pages:
            context = browser.new_context(viewport={"width": 1280, "height": 900})
            page = context.new_page()
            session, sizes = context.new_cdp_session(page), list[float]()
            session.send("Network.enable")
            session.on("Network.loadingFinished", lambda event, sizes=sizes: sizes.append(event["encodedDataLength"]))
            before, served = _used(root), processor_s(pid)
            page.goto(site + path, wait_until="commit")
            mark = CONTENT if name == RACE else PAINTED
            while not (frame_ms := page.evaluate(mark)):
                page.wait_for_timeout(20)
            figures = {"frame_ms": frame_ms, "browser_ms": (_used(root) - before) * 1000}
            figures |= {"server_ms": (processor_s(pid) - served) * 1000, "kb": sum(sizes) / 1000, "answers": len(sizes)}
            if name != RACE:
                assert page.evaluate(CARS) == RUNS, "all cars are on the map"
            least = found.setdefault(name, figures)
            found[name] = {key: min(value, least[key]) for key, value in figures.items()}
            context.close()
        browser.close()
    return {name: {key: round(value, 1) for key, value in figures.items()} for name, figures in found.items()}


async def _people(site: str, pages: Sequence[str], sent: Sequence[str], pause_s: float) -> dict[str, list[float]]:
    """Everyone of ``sent`` opens a comparison ``ROUNDS`` times, the first time within ``pause_s``: milliseconds of each
    answer by its part."""
    where = urlsplit(site)
    took: dict[str, list[float]] = {part: [] for part in PARTS}

    async def person(number: int, cookie: str) -> None:
        incoming, outgoing = await asyncio.open_connection(where.hostname, where.port)

        async def get(part: str, path: str) -> str:
            began = time.perf_counter()
            fields = f"Host: {where.netloc}\r\nCookie: {cookie}\r\nAccept-Encoding: gzip\r\n"
            outgoing.write(f"GET {path} HTTP/1.1\r\n{fields}\r\n".encode())
            head = (await incoming.readuntil(b"\r\n\r\n")).lower()
            length = int(head.partition(b"content-length: ")[2].partition(b"\r\n")[0])
            body = await incoming.readexactly(length)
            assert head.startswith(b"http/1.1 200"), (path, head)
            took[part].append((time.perf_counter() - began) * 1000)
            return (gzip.decompress(body) if b"content-encoding: gzip" in head else body).decode()

        await asyncio.sleep(random.Random(number).random() * pause_s)
        for turn in range(ROUNDS):
            began = time.perf_counter()
            page = await get("page", pages[(number + turn) % len(pages)])
            await get("documents", json.loads(_attribute(page, "data-viewer"))["together"])
            part = await get("analysis", _attribute(page, "data-analysis"))
            await get("telemetry", json.loads(_attribute(part, "data-telemetry"))["url"])
            await asyncio.sleep(max(0.0, began + pause_s - time.perf_counter()))
        outgoing.close()

    await asyncio.gather(*(person(number, cookie) for number, cookie in enumerate(sent)))
    return took


def _attribute(page: str, name: str) -> str:
    found = re.search(f'{name}="([^"]+)"', page)
    assert found, name
    return html.unescape(found[1])


def at_once(site: str, pid: int, pages: Sequence[str], sent: Sequence[str], pause_s: float) -> dict[str, Any]:
    """What :func:`_people` waited, and the server's processor milliseconds for each comparison."""
    before = processor_s(pid)
    took = asyncio.run(_people(site, pages, sent, pause_s))
    spent = (processor_s(pid) - before) * 1000 / len(took["page"])
    waited = {
        part: {f"p{share}_ms": round(statistics.quantiles(each, n=100)[share - 1], 1) for share in (50, 95)}
        for part, each in took.items()
    }
    return {"opened": len(took["page"]), "processor_ms": round(spent, 1), "waited": waited}


def measure(people: int = PEOPLE, pause_s: float = PAUSE_S, turns: int = TURNS) -> dict[str, Any]:
    """See the module. ``turns``: 0 without a browser. Django is set up on an empty database.

    Raises LoadError where a server does not start.
    """
    from django.utils import timezone

    runs = eight_runs(timezone.now())
    pages, race = [comparison(runs, first) for first in range(RUNS)], "/races/compared/"
    found: dict[str, Any] = {"people": people, "pause_s": pause_s, "cores": len(os.sched_getaffinity(0)), "pages": {}}
    with server("benchmarks.bare", 2) as (bare, pid):
        asyncio.run(_ask(f"{bare}/", 200, 1.0, ()))
        before = processor_s(pid)
        asyncio.run(_ask(f"{bare}/", 200, 3.0, ()))
        found[BARE] = round((processor_s(pid) - before) * 1000 / 600, 2)
    if turns:
        with server("config.wsgi", 2) as (site, pid):
            found["pages"] |= in_a_browser(site, pid, [(RACE, race), (COLD, pages[0])])
            found["pages"] |= in_a_browser(site, pid, [(RACE, race), (WARM, pages[0])] * turns)
        for name in (COLD, WARM):
            spent = found["pages"][name]["browser_ms"] / found["pages"][RACE]["browser_ms"]
            found["pages"][name]["of_race"] = round(spent, 2)
    with server("config.wsgi", 2) as (site, pid):
        found["at_once"] = at_once(site, pid, pages, cookies(people), pause_s)
    found["at_once"]["of_bare"] = round(found["at_once"]["processor_ms"] / max(found[BARE], 0.01))
    found["load"] = round(os.getloadavg()[0], 1)
    return found


def misses(figures: Mapping[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    missed = []
    for name in (COLD, WARM):
        page = figures["pages"].get(name)
        if page and page["frame_ms"] > FRAME_MS:
            missed.append(f"{name}: the first frame after {page['frame_ms']:.0f} ms")
        if page and page["kb"] > FIRST_KB:
            missed.append(f"{name}: {page['kb']:.0f} kB until the first frame")
    warm = figures["pages"].get(WARM)
    if warm and warm["of_race"] > OF_RACE:
        missed.append(f"{WARM}: {warm['of_race']} times the processor time of the {RACE}")
    for part, waited in figures["at_once"]["waited"].items():
        if waited["p95_ms"] > PAGE_MS:
            missed.append(f"{figures['people']} people: p95 of the {part} {waited['p95_ms']} ms")
    return missed


def table(figures: Mapping[str, Any]) -> str:
    """The figures for a reader."""
    lines = [f"{figures['cores']} cores, load {figures['load']}. Until the first frame, milliseconds of the processor:"]
    lines.append(f"{'':36}{'frame ms':>10}{'browser':>10}{'server':>10}{'kB':>8}{'answers':>9}{'of race':>9}")
    for name, page in figures["pages"].items():
        times = f"{page['frame_ms']:10.0f}{page['browser_ms']:10.0f}{page['server_ms']:10.0f}"
        lines.append(f"{name:36}{times}{page['kb']:8.0f}{page['answers']:9.0f}{page.get('of_race', ''):>9}")
    once = figures["at_once"]
    lines += [
        "",
        f"{figures['people']} people, each with another comparison every {figures['pause_s']:.0f} s: "
        f"{once['processor_ms']} ms of the server's processor for each, {once['of_bare']} times a bare view's",
    ]
    lines += [
        f"{part:36}p50 {each['p50_ms']:8.1f} ms   p95 {each['p95_ms']:8.1f} ms" for part, each in once["waited"].items()
    ]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """The figures as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("comparing", "What it costs to compare eight runs.")
    parser.add_argument("--people", type=int, default=PEOPLE)
    parser.add_argument("--pause", type=float, default=PAUSE_S, help="seconds between two comparisons of a person")
    parser.add_argument("--turns", type=int, default=TURNS, help="times that the browser opens it; 0: no browser")
    options = parser.parse_args(arguments)
    with database(False):
        figures = measure(options.people, options.pause, options.turns)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
