"""``python -m benchmarks.board [--json]``: what boards cost as they grow, from a thousand entries to a million.

Pages, a rank, the API's page, a recorded result, closing a month, and requests a second with ``wrk``. Runs on a
SQLite database of its own in a temporary folder, or with ``--postgres`` on a PostgreSQL server of its own. Look at the
ratios: nothing should notice how long the board is. Calls are timed by the processor, the database server's time
included, sizes take turns, and the least of all runs counts, so that a busy machine disturbs little.
``python -m benchmarks.curves`` draws what ``--json`` printed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from pathlib import Path
from typing import Any

from . import load
from .board_rows import counted_at_the_end, fill, make_race, make_racers
from .report import command, report

SIZES = (1_000, 10_000, 100_000, 1_000_000)
CLOSED = 100_000  # entries of the month that is closed
RATIO, CLOSING_S, QUERIES = 1.5, 30.0, 12  # what is promised
PAGES = (
    *("first page", "somebody's first page", "middle page", "last page"),
    *("one rank", "board page of the site", "API page"),
)


def measure(
    sizes: tuple[int, ...] = SIZES, runs: int = 15, closed: int = CLOSED, load_s: int = 5, turns: int = load.TURNS
) -> dict[str, Any]:
    """Milliseconds of the processor (least of ``runs``) of each look at each size, the last by the first; the most
    queries of each look; the seconds of a close; requests a second of the longest board's page, ``load_s`` at a time,
    the best of ``turns``.

    Django is set up on an empty database.
    """
    from django.db import connection
    from django.utils import timezone

    load_before, now = os.getloadavg()[0], timezone.now()
    with counted_at_the_end():
        make_racers(max(*sizes, closed), now)
        races = {size: make_race(f"board-{size}", oval(), now) for size in sizes}
        for size, race in races.items():
            fill(race, size, now)
    looks = {name: {size: _look(name, race) for size, race in races.items()} for name in PAGES}
    curve = {name: _least(calls, runs) for name, calls in looks.items()}
    queries = {name: max(_queries(ready()) for ready in calls.values()) for name, calls in looks.items()}
    curve["recorded result"] = _least({size: _result(race) for size, race in races.items()}, runs)
    pages = load.measure({size: races[size] for size in (sizes[0], sizes[-1])}, load_s, turns) if load_s else None
    return {
        "database": connection.vendor,
        "sizes": list(sizes),
        "runs": runs,
        "looks": {
            name: {"ms": [times[size] for size in sizes], "ratio": times[sizes[-1]] / times[sizes[0]]}
            for name, times in curve.items()
        },
        "queries": queries,
        "close": {"entries": closed, **_close(closed)},
        "requests": pages,
        "machine": {"cores": len(os.sched_getaffinity(0)), "load": [load_before, os.getloadavg()[0]]},
    }


def _least(calls: dict[int, Callable[[], Callable[[], Any]]], runs: int) -> dict[int, float]:
    """The least milliseconds of each size's call. Each call is made ready first, which is not timed."""
    clock = processor_clock()
    times: dict[int, list[float]] = {size: [] for size in calls}
    for number in range(runs + 1):
        for size, ready in calls.items():
            call = ready()
            started = clock()
            call()
            if number:  # the first warms up
                times[size].append(1000.0 * (clock() - started))
    return {size: min(every) for size, every in times.items()}


def processor_clock() -> Callable[[], float]:
    """Seconds of the processor that this process and its connection's server process have taken."""
    from django.db import connection

    if connection.vendor == "sqlite":  # works in this process
        return time.process_time
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_backend_pid()")
        schedule = Path(f"/proc/{cursor.fetchone()[0]}/schedstat")
    return lambda: time.process_time() + int(schedule.read_text().split()[0]) / 1e9


def _queries(call: Callable[[], Any]) -> int:
    from django.db import connection
    from django.test.utils import CaptureQueriesContext

    with CaptureQueriesContext(connection) as caught:
        call()
    return len(caught)


def _look(name: str, race: Any) -> Callable[[], Callable[[], Any]]:
    """What is timed, made anew for each run."""
    from django.conf import settings
    from django.test import Client, override_settings

    from core.streams import shared_pieces
    from races.boards.selectors.board import board, rank_of
    from races.boards.selectors.counts import totals_of

    count = totals_of(race).rows
    middle = board(race, page=max(1, count // 100)).rows[0].entry
    client = Client()
    # each page is made: readers would be given the one that was made before
    shared_pieces.LIVES_S = -1.0
    with override_settings(
        MIDDLEWARE=[name for name in settings.MIDDLEWARE if name != "config.middleware.shared_pages.SharedPages"]
    ):
        client.handler.load_middleware()
    looks: dict[str, Callable[[], Any]] = {
        "first page": lambda: board(race),
        "somebody's first page": lambda: board(race, middle.racer),
        "middle page": lambda: board(race, page=count // 100),
        "last page": lambda: board(race, page=count),
        "one rank": lambda: rank_of(middle),
        "board page of the site": lambda: _get(client, race.get_absolute_url()),
        "API page": lambda: _get(client, f"/api/v1/races/{race.slug}/board/"),
    }
    return lambda: looks[name]


def _get(client: Any, address: str) -> None:
    answer = client.get(address)
    assert answer.status_code == 200, (address, answer.status_code)


def _result(race: Any) -> Callable[[], Callable[[], Any]]:
    """A car of a new racer whose result is recorded: the transaction that ends an evaluation."""
    from django.utils import timezone

    from evaluation.running.queue.jobs import finish_evaluation
    from races.entries.services.submissions import submit_model
    from tests.factories import a_model, a_racer, laps, outcome, start

    def ready() -> Callable[[], Any]:
        racer, now = a_racer(), timezone.now()
        running = start(submit_model(race=race, racer=racer, model=a_model(racer), now=now).evaluation, now)
        ended, lease = outcome(laps(12_000, 12_001, 12_002)), running.lease
        assert lease is not None, "it was claimed"
        return lambda: finish_evaluation(pk=running.pk, lease=lease, outcome=ended, now=now)

    return ready


def _close(entries: int) -> dict[str, float]:
    """Seconds to make an open race official, of the clock and of the processor: its tenth is promoted."""
    from django.utils import timezone

    from league.models import Membership
    from league.seasons.services.seasons import create_season, schedule_round
    from league.stewarding.official_results import close_round

    now = timezone.now()
    season = create_season(slug="bench", name="Bench", starts_on=now.date(), ends_on=(now + timedelta(days=30)).date())
    times: dict[str, Any] = {"opens_at": now - timedelta(days=1), "closes_at": now + timedelta(days=1)}
    round_ = schedule_round(season=season, number=1, division="open", now=now, name="Month", track=oval(), **times)
    with counted_at_the_end():
        fill(round_.race, entries, now)
    clock, began = processor_clock(), time.perf_counter()
    processor = clock()
    close_round(round=round_, now=times["closes_at"])
    seconds, processor_s = time.perf_counter() - began, clock() - processor
    assert Membership.objects.count() >= entries // 20
    return {"seconds": seconds, "processor_s": processor_s}


def oval() -> Any:
    from tracks.models import Track
    from tracks.services import load_catalogue

    if not Track.objects.filter(slug="oval").exists():
        load_catalogue()
    return Track.objects.get(slug="oval")


@contextmanager
def database(on_postgres: bool) -> Iterator[None]:
    """An empty database of its own, migrated. ``BENCH_DATABASE`` names one to begin with a copy of, where migrating
    takes longer than what is measured: a SQLite file, for a server the data folder that tests/postgres.py keeps."""
    ready = os.environ.get("BENCH_DATABASE")
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as folder:
        os.environ |= {"PADDOCK_DATA": folder, "DJANGO_SETTINGS_MODULE": "config.settings"}
        os.environ["PADDOCK_HOSTS"] = "testserver,127.0.0.1"
        os.environ.pop("DATABASE_URL", None)
        server: Any = nullcontext()
        if on_postgres:
            from tests.postgres import MIGRATED, postgres

            server = postgres(copy_of=Path(ready), name=MIGRATED) if ready else postgres()
        elif ready:
            shutil.copy(ready, Path(folder) / "paddock.sqlite3")
        with server as url:
            if url:
                os.environ["DATABASE_URL"] = url
            import django
            from django.core.management import call_command
            from django.db import connections

            django.setup()
            _without_a_bell()
            call_command("migrate", interactive=False, verbosity=0)
            call_command("collectstatic", interactive=False, verbosity=0)
            try:
                yield
            finally:
                connections.close_all()


def _without_a_bell() -> None:
    """There is no broker: what is queued here is finished by hand."""
    from evaluation import tasks

    tasks.work.apply_async = lambda **options: None


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    found = [
        f"{name}: {look['ratio']:.2f} times from {figures['sizes'][0]:,} to {figures['sizes'][-1]:,} entries"
        for name, look in figures["looks"].items()
        if look["ratio"] > RATIO
    ]
    if figures["close"]["seconds"] > CLOSING_S:
        found.append(f"closing {figures['close']['entries']:,} entries took {figures['close']['seconds']:.0f} s")
    found += [f"{name}: {count} queries" for name, count in figures["queries"].items() if count > QUERIES]
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    lines = [
        f"{figures['database']:26}"
        + "".join(f"{size:>14,}" for size in figures["sizes"])
        + f"{'ratio':>8}{'queries':>9}"
    ]
    for name, look in figures["looks"].items():
        times = "".join(f"{ms:>11.2f} ms" for ms in look["ms"])
        lines.append(f"{name:26}{times}{look['ratio']:>8.2f}{figures['queries'].get(name, ''):>9}")
    close = figures["close"]
    lines.append(
        f"closing {close['entries']:,} entries: {close['seconds']:.1f} s, {close['processor_s']:.1f} s of the processor"
    )
    for name, one in (figures["requests"] or {}).items():
        lines.append(
            f"{name:26}{one['per_second']:>8.0f} requests a second,"
            f"{one['per_processor_second']:>8.0f} for each second of the server's processes"
        )
    before, after = figures["machine"]["load"]
    lines.append(f"{figures['machine']['cores']} cores, load {before:.1f} before and {after:.1f} after")
    return "\n".join(lines)


def numbers(text: str) -> tuple[int, ...]:
    """Whole numbers with commas between them, as an option names them. ValueError when it is something else."""
    return tuple(map(int, text.split(",")))


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = command("board", "What boards cost as they grow.")
    parser.add_argument("--sizes", type=numbers, default=SIZES, help="entries, the fewest first")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--closed", type=int, default=CLOSED, help="entries of the month that is closed")
    parser.add_argument("--load", type=int, default=5, help="whole seconds of load at a time; 0: none, without wrk")
    parser.add_argument("--turns", type=int, default=load.TURNS, help="how often that load is measured")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server that is started for it")
    options = parser.parse_args(arguments)
    if options.load and not load.is_there():
        parser.error(load.MISSING)
    with database(options.postgres):
        figures = measure(options.sizes, options.runs, options.closed, options.load, options.turns)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
