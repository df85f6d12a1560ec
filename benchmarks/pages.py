"""``python -m benchmarks.pages [--json]``: what each page that people open costs, by reader.

All requests go through the middleware in one process, with the settings of a running site. Milliseconds of the
processor (on PostgreSQL with the time of the server's process), medians: the first request of a second, after a commit,
which draws the parts that readers share, and a request after another reader's, which finds them. The promise is about
the second: shared parts are drawn once a second, not once a reader. Beside each page, in the same run, a view that
loads the session and its racer by Django's own means, and nothing else. ``--big``: a site with 2,000 racers, 200 races
and 50,000 runs instead of the demo season.
"""

from __future__ import annotations

import gc
import logging
import os
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from .board import database, processor_clock
from .page_rows import Site, make_site
from .report import command, report

RUNS, WARM_UP, BARE_TURNS = 7, 2, 3
RATIO, QUERIES = 10.0, 8  # promised of a signed-in page whose shared parts are drawn
KEPT_S = 2.0  # longer than any page keeps what it shares
BARE = "bare signed-in view"
SIGNED_IN = ("no car", "waiting car", "results", "organiser", "admin")
READERS: dict[str, tuple[str, ...]] = {
    "home": ("guest", *SIGNED_IN),
    "races": ("guest", *SIGNED_IN),
    "race": ("guest", *SIGNED_IN),
    "race with an organiser": ("guest", "results", "organiser", "admin"),
    "board, page 2": ("guest", "no car", "results", "organiser", "admin"),
    "run": ("guest", "no car", "results", "organiser", "admin"),
    "garage": SIGNED_IN,
    "seasons": ("guest", "results", "organiser", "admin"),
    "season": ("guest", "no car", "results", "organiser", "admin"),
    "live event": ("guest", "no car", "results", "organiser", "admin"),
    "notices": ("no car", "results", "admin"),
    "wizard": ("no car", "results"),
    **dict.fromkeys(("wizard, clone", "training", "model", "own runs"), ("results",)),
    "new run": ("no car", "results"),
    "comparison": ("guest", "no car", "results"),
    "following": ("no car", "results"),
    "usage": ("no car", "results"),
    "usage of all": ("admin",),
    **dict.fromkeys((f"admin: {name}" for name in ("races", "race", "racers", "racer", "runs", "run")), ("admin",)),
}
_KEEPING = ("SAVEPOINT", "RELEASE", "BEGIN", "COMMIT")


def measure(pages: Sequence[str] = tuple(READERS), runs: int = RUNS, *, big: bool = False) -> dict[str, Any]:
    """Of each page and reader ``ms``, ``ratio`` by the bare view, ``queries`` and ``bytes`` when nothing is kept,
    ``shared_ms``, ``shared_ratio`` and ``shared_queries`` after another reader's request, and ``bare_ms``. Django is
    set up on an empty database."""
    from django.db import connection
    from django.utils import timezone

    site, load = quiet_site(timezone.now(), big=big), os.getloadavg()[0]
    bare = bare_request(site.readers["no car"])
    rows = [
        {"page": page, "reader": reader, **_measured(site, page, reader, bare, runs)}
        for page in pages
        for reader in READERS[page]
    ]
    return {
        "database": connection.vendor,
        "site": "2,000 racers, 200 races, 50,000 runs" if big else "the demo season",
        "bare_ms": statistics.median(row["bare_ms"] for row in rows),
        "pages": rows,
        "machine": {"cores": len(os.sched_getaffinity(0)), "load": [load, os.getloadavg()[0]]},
    }


def quiet_site(now: Any, *, big: bool = False) -> Site:
    """The site, with nobody to wake: no broker, no stream."""
    from django.conf import settings

    from config.celery import app as celery_app
    from config.serving.web import prepare_memory

    celery_app.conf.update(broker_url="memory://", task_always_eager=False)
    settings.STREAM_BELL_URL = ""
    logging.disable(logging.ERROR)  # the cache that is away
    site = make_site(now, big=big)
    gc.collect()
    prepare_memory()  # as the processes of the web server
    return site


def request(site: Site, page: str, racer: Any) -> Callable[[], Any]:
    """Ask for a page as a racer, or as a guest."""
    client, path = client_of(racer), site.path(page, racer)

    def ask() -> Any:
        answer = client.get(path)
        assert answer.status_code == 200, (path, racer, answer.status_code)
        return answer

    return ask


def client_of(racer: Any, backend: str = "accounts.backends.PasswordBackend") -> Any:
    """A browser with a session of the racer; None: without."""
    from django.test import Client

    client = Client()
    if racer is not None:
        client.force_login(racer, backend=backend)
    return client


def bare_request(racer: Any) -> Callable[[], Any]:
    """Ask for a line of text that is sent once the session and its racer are loaded, by Django's own session store and
    backend: a yardstick that no change of ours moves."""
    from django.http import HttpRequest, HttpResponse
    from django.test import override_settings
    from django.urls import path

    def hello(request: HttpRequest) -> HttpResponse:
        assert request.user.pk == racer.pk
        return HttpResponse("hello", content_type="text/plain")

    client = client_of(racer, "django.contrib.auth.backends.ModelBackend")
    middleware = ("sessions.middleware.Session", "auth.middleware.Authentication")
    bare = [f"django.contrib.{name}Middleware" for name in middleware]
    with override_settings(MIDDLEWARE=bare, SESSION_ENGINE="django.contrib.sessions.backends.db"):
        client.handler.load_middleware()
    urls = type("Addresses", (), {"urlpatterns": [path("", hello)]})
    return lambda: override_settings(ROOT_URLCONF=urls)(client.get)("/")


def forget_kept(site: Site) -> None:
    """Commit to the race of the month, as every result does, and set the clock of this process forward: what is kept
    for a second is old. Then the clock stands, however slow the machine is."""
    from django.db import transaction
    from django.db.models import F

    from races.events import record_board
    from races.models import Race

    with transaction.atomic():
        Race.objects.filter(pk=site.month.pk).update(description=F("description"))
        record_board(site.month)
    now = time.monotonic() + KEPT_S
    time.monotonic = lambda: now


def _measured(site: Site, page: str, reader: str, bare: Callable[[], Any], runs: int) -> dict[str, Any]:
    """The figures of a page. The bare view takes turns with it: the speed of a shared processor changes."""
    ask = request(site, page, site.readers[reader])
    # each client has middleware of its own, which keeps guests' pages
    other = ask if reader == "guest" else request(site, page, site.others[reader])
    took = []
    for _ in range(WARM_UP + runs):
        forget_kept(site)
        changed = _cost(ask)
        forget_kept(site)
        other()
        took.append((changed, _cost(ask), statistics.median(_cost(bare) for _ in range(BARE_TURNS))))
    forget_kept(site)
    sent, answer = statements(ask)
    forget_kept(site)
    other()
    sent_again, _ = statements(ask)
    changed, shared, of_bare = (statistics.median(each) for each in zip(*took[WARM_UP:], strict=True))
    return {
        "ms": changed,
        "ratio": changed / of_bare,
        "queries": len(sent),
        "bytes": len(answer.content),
        "shared_ms": shared,
        "shared_ratio": shared / of_bare,
        "shared_queries": len(sent_again),
        "bare_ms": of_bare,
    }


def _cost(ask: Callable[[], Any]) -> float:
    clock = processor_clock()
    began = clock()
    ask()
    return (clock() - began) * 1000


def statements(ask: Callable[[], Any]) -> tuple[list[str], Any]:
    """The SQL that a request sends, without what keeps the transaction; and its answer."""
    from django.db import connection
    from django.test.utils import CaptureQueriesContext

    with CaptureQueriesContext(connection) as captured:
        answer = ask()
    return [query["sql"] for query in captured if not query["sql"].startswith(_KEEPING)], answer


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    signed_in = [row for row in figures["pages"] if row["reader"] != "guest"]
    return [
        f"{row['page']}, {row['reader']}: {row['shared_ratio']:.1f} bare views, {row['shared_queries']} queries"
        for row in signed_in
        if row["shared_ratio"] > RATIO or row["shared_queries"] > QUERIES
    ]


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    cores, (before, after) = figures["machine"]["cores"], figures["machine"]["load"]
    lines = [
        f"{figures['database']}, {figures['site']}; {cores} cores, load {before:.1f} to {after:.1f}",
        f"{BARE} {figures['bare_ms']:.2f} ms. Medians of processor time: first request after a commit, nothing kept;",
        "shared: after another reader's request, nothing committed since.",
        "",
        f"{'':37}{'first':>25}{'':>10}{'shared':>25}",
        f"{'page':24}{'reader':13}{'ms':>8}{'times':>8}{'queries':>9}{'bytes':>10}{'ms':>8}{'times':>8}{'queries':>9}",
    ]
    for row in figures["pages"]:
        first = f"{row['ms']:>8.1f}{row['ratio']:>8.1f}{row['queries']:>9}{row['bytes']:>10,}"
        again = f"{row['shared_ms']:>8.1f}{row['shared_ratio']:>8.1f}{row['shared_queries']:>9}"
        lines.append(f"{row['page']:24}{row['reader']:13}{first}{again}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Fill a database, measure, print; 1 when a promise is not kept."""
    parser = command("pages", "What each page costs, by reader.")
    parser.add_argument("--pages", nargs="+", choices=list(READERS), default=list(READERS), help="only these")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--big", action="store_true", help="a site with 2,000 racers, 200 races and 50,000 runs")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server of its own")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.pages, options.runs, big=options.big)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
