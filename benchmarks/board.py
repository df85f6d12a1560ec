"""``python -m benchmarks.board [--json]``: what boards cost as they grow, from a thousand entries to a million.

Pages, a rank, the API's page, a recorded result, and closing a month. Runs on a SQLite database of its own in a
temporary folder, or with ``--postgres`` on a PostgreSQL server of its own. Look at the ratios: nothing should notice
how long the board is. Sizes take turns, and the least of all runs counts, so that a busy machine disturbs little.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from typing import Any

SIZES = (1_000, 10_000, 100_000, 1_000_000)
CLOSED = 100_000  # entries of the month that is closed
RATIO, CLOSING_S = 1.5, 30.0  # what is promised
PAGES = (
    *("first page", "somebody's first page", "middle page", "last page"),
    *("one rank", "board page of the site", "API page"),
)


def measure(sizes: tuple[int, ...] = SIZES, runs: int = 15, closed: int = CLOSED) -> dict[str, Any]:
    """Milliseconds (least of ``runs``) of each look at each size, the last by the first, and the seconds of a close.

    Django is set up on an empty database.
    """
    from django.db import connection

    _racers(max(*sizes, closed))
    races = {size: _race_with_entries(size) for size in sizes}
    looks = {name: {size: _look(name, race) for size, race in races.items()} for name in PAGES}
    curve = {name: _least(calls, runs) for name, calls in looks.items()}
    curve["recorded result"] = _least({size: _result(race) for size, race in races.items()}, runs)
    return {
        "database": connection.vendor,
        "sizes": list(sizes),
        "runs": runs,
        "looks": {
            name: {"ms": [times[size] for size in sizes], "ratio": times[sizes[-1]] / times[sizes[0]]}
            for name, times in curve.items()
        },
        "close": {"entries": closed, "seconds": _close(closed)},
    }


def _least(calls: dict[int, Callable[[], Callable[[], Any]]], runs: int) -> dict[int, float]:
    """The least milliseconds of each size's call. Each call is made ready first, which is not timed."""
    from django.db import connection

    # SQLite works in this process: its time alone counts. A server's work is seen from outside only.
    clock = time.process_time if connection.vendor == "sqlite" else time.perf_counter
    times: dict[int, list[float]] = {size: [] for size in calls}
    for number in range(runs + 1):
        for size, ready in calls.items():
            call = ready()
            started = clock()
            call()
            if number:  # the first warms up
                times[size].append(1000.0 * (clock() - started))
    return {size: min(every) for size, every in times.items()}


def _look(name: str, race: Any) -> Callable[[], Callable[[], Any]]:
    """What is timed, made anew for each run."""
    from django.test import Client

    from races.selectors import board, rank_of
    from races.selectors.counting import totals_of

    count = totals_of(race).rows
    middle = board(race, page=max(1, count // 100)).rows[0].entry
    client = Client()
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

    from evaluation.services import finish_evaluation
    from races.services import submit_model
    from tests.factories import a_model, a_racer, laps, outcome, start

    def ready() -> Callable[[], Any]:
        racer, now = a_racer(), timezone.now()
        running = start(submit_model(race=race, racer=racer, model=a_model(racer), now=now).evaluation, now)
        ended = outcome(laps(12_000, 12_001, 12_002))
        return lambda: finish_evaluation(evaluation_id=running.pk, lease=running.lease, outcome=ended, now=now)

    return ready


def _close(entries: int) -> float:
    """Seconds to make an open race official: its tenth is promoted."""
    from django.utils import timezone

    from league.models import Membership
    from league.services import close_round, create_season, schedule_round

    now = timezone.now()
    season = create_season(slug="bench", name="Bench", starts_on=now.date(), ends_on=(now + timedelta(days=30)).date())
    times = {"opens_at": now - timedelta(days=1), "closes_at": now + timedelta(days=1)}
    round_ = schedule_round(season=season, number=1, division="open", now=now, name="Month", track=_track(), **times)
    _fill(round_.race, entries)
    started = time.perf_counter()
    close_round(round=round_, now=times["closes_at"])
    seconds = time.perf_counter() - started
    assert Membership.objects.count() >= entries // 20
    return seconds


def _track() -> Any:
    from tracks.models import Track
    from tracks.services import load_catalogue

    if not Track.objects.filter(slug="oval").exists():
        load_catalogue()
    return Track.objects.get(slug="oval")


def _racers(count: int) -> None:
    from django.utils import timezone

    from league.models import Racer
    from league.services.bulk import insert_rows

    rows = ((f"r{n}", f"r{n}@example.org", "!", timezone.now()) for n in range(count))
    insert_rows(Racer, ("alias", "email", "password", "joined_at"), rows)


def _race_with_entries(count: int) -> Any:
    from django.utils import timezone

    from races.models import Kind, Race

    now = timezone.now()
    race = Race.objects.create(
        kind=Kind.COMMUNITY,
        slug=f"board-{count}",
        name=f"Board of {count}",
        track=_track(),
        opens_at=now - timedelta(days=1),
        closes_at=now + timedelta(days=1),
        laps=3,
        minimum_laps=3,
    )
    _fill(race, count)
    return race


def _fill(race: Any, count: int) -> None:
    """Entries of which nine in ten are classified, with many equal scores."""
    from django.db import connection
    from django.utils import timezone

    from league.models import Racer
    from league.services.bulk import insert_rows
    from races.models import Entry

    racers = Racer.objects.filter(alias__startswith="r").order_by("pk").values_list("pk", flat=True)[:count]
    now = timezone.now()
    columns = ("race", "racer", "entered_at", "classified", "score_ms", "rank_score", "average_ms", "best_lap_ms")
    more = ("rank_lap", "total_ms", "complete_laps", "sectors", "achieved_at", "own_lap_ms", "last_number")

    def rows() -> Iterator[tuple]:
        for number, racer in enumerate(racers):
            score = 10_000 + number * 7919 % 50_000  # 7919 is prime: no order, and equal scores among many
            third = score // 3
            times = (score,) * 4 + (score, 3 * score, 3, [third, third, score - 2 * third], now, score, 1)
            if number % 10:
                yield (race.pk, racer, now, True, *times)
            else:
                unfinished = (None, 2 * 10**12, None, None, 2**31 - 1, None, 0, [], None, None, 0)
                yield (race.pk, racer, now, False, *unfinished)

    insert_rows(Entry, (*columns, *more), rows())
    if connection.vendor == "postgresql":
        with connection.cursor() as cursor:
            cursor.execute("ANALYZE")


@contextmanager
def database(on_postgres: bool) -> Iterator[None]:
    """An empty database of its own, migrated."""
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as folder:
        os.environ |= {"PADDOCK_DATA": folder, "DJANGO_SETTINGS_MODULE": "league.settings"}
        os.environ["PADDOCK_HOSTS"] = "testserver"
        os.environ.pop("DATABASE_URL", None)
        server: Any = nullcontext()
        if on_postgres:
            from tests.postgres import postgres

            server = postgres()
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
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    lines = [f"{figures['database']:26}" + "".join(f"{size:>14,}" for size in figures["sizes"]) + f"{'ratio':>8}"]
    for name, look in figures["looks"].items():
        lines.append(f"{name:26}" + "".join(f"{ms:>11.2f} ms" for ms in look["ms"]) + f"{look['ratio']:>8.2f}")
    lines.append(f"closing {figures['close']['entries']:,} entries: {figures['close']['seconds']:.1f} s")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = argparse.ArgumentParser("python -m benchmarks.board", description="What boards cost as they grow.")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="entries, the fewest first")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--closed", type=int, default=CLOSED, help="entries of the month that is closed")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server that is started for it")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(tuple(map(int, options.sizes.split(","))), options.runs, options.closed)
    print(json.dumps(figures, indent=2) if options.json else table(figures))
    for miss in misses(figures):
        print(f"missed: {miss}", file=sys.stderr)
    return 1 if misses(figures) else 0


if __name__ == "__main__":
    sys.exit(main())
