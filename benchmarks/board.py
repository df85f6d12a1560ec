"""``python -m benchmarks.board [--json]``: what a page of a board costs with 1,000 entries and with 100,000.

Runs on a SQLite database of its own in a temporary folder. Look at the ratios: a page should hardly notice how long the
board is.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

FEW, MANY = 1_000, 100_000


def measure(few: int = FEW, many: int = MANY, runs: int = 5) -> dict[str, Any]:
    """Milliseconds (medians) of each page at both sizes, and their ratio. Django is set up on an empty database."""
    races = {count: _race_with_entries(count) for count in (few, many)}
    pages: dict[str, dict[str, float]] = {}
    for name in ("first page", "first page of somebody in the middle", "middle page", "last page", "one rank"):
        small, large = (_milliseconds(_look(name, race), runs) for race in races.values())
        pages[name] = {"few_ms": small, "many_ms": large, "ratio": large / small}
    return {"few": few, "many": many, "runs": runs, "pages": pages}


def _look(name: str, race: Any) -> Callable[[], Any]:
    """What is timed, as a call without arguments."""
    from races.selectors import board, rank_of
    from races.selectors.boards import board_entries

    count = board_entries(race).count()
    middle = board_entries(race).select_related("racer", "race")[count // 2]
    return {
        "first page": lambda: board(race),
        "first page of somebody in the middle": lambda: board(race, middle.racer),
        "middle page": lambda: board(race, page=count // 100),
        "last page": lambda: board(race, page=count),
        "one rank": lambda: rank_of(middle),
    }[name]


def _milliseconds(look: Callable[[], Any], runs: int) -> float:
    look()
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        look()
        times.append(1000.0 * (time.perf_counter() - started))
    return statistics.median(times)


def _race_with_entries(count: int) -> Any:
    """A race in which nine of ten entries are classified, with many equal scores."""
    from django.utils import timezone

    from league.models import Racer
    from races.models import Entry, Kind, Race
    from tracks.models import Track
    from tracks.services import load_catalogue

    load_catalogue()

    now = timezone.now()
    race = Race.objects.create(
        kind=Kind.COMMUNITY,
        slug=f"board-{count}",
        name=f"Board of {count}",
        track=Track.objects.get(slug="oval"),
        opens_at=now - timedelta(days=1),
        closes_at=now + timedelta(days=1),
        laps=3,
        minimum_laps=3,
    )
    racers = Racer.objects.bulk_create(
        [Racer(alias=f"r{count}-{n}", email=f"r{count}-{n}@example.org", password="!") for n in range(count)],
        batch_size=2000,
    )
    Entry.objects.bulk_create(
        [_entry(race, racer, number, now) for number, racer in enumerate(racers)], batch_size=1000
    )
    return race


def _entry(race: Any, racer: Any, number: int, now: Any) -> Any:
    from races.models import Entry

    entry = Entry(race=race, racer=racer, entered_at=now)
    if number % 10:
        score = 10_000 + number * 7919 % 5_000  # 7919 is prime: no order, and equal scores among many
        entry.classified, entry.score_ms, entry.rank_score = True, score, score
        entry.average_ms = entry.best_lap_ms = entry.rank_lap = score
        entry.total_ms, entry.complete_laps = 3 * score, 3
        entry.sectors = [score // 3, score // 3, score - 2 * (score // 3)]
        entry.achieved_at = now
        entry.own_lap_ms = score
        entry.own_sector_1_ms, entry.own_sector_2_ms, entry.own_sector_3_ms = entry.sectors
        entry.submission_count = entry.last_number = 1
    return entry


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print."""
    parser = argparse.ArgumentParser("python -m benchmarks.board", description="What a page of a board costs.")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--few", type=int, default=FEW)
    parser.add_argument("--many", type=int, default=MANY)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="paddock-bench-") as folder:
        os.environ["PADDOCK_DATA"] = folder
        os.environ.pop("DATABASE_URL", None)
        os.environ["DJANGO_SETTINGS_MODULE"] = "league.settings"
        import django
        from django.core.management import call_command

        django.setup()
        call_command("migrate", interactive=False, verbosity=0)
        figures = measure(options.few, options.many, options.runs)
    if options.json:
        print(json.dumps(figures, indent=2))
        return 0
    print(f"{'':38}{figures['few']:>10,}{figures['many']:>12,}{'ratio':>8}")
    for name, page in figures["pages"].items():
        print(f"{name:38}{page['few_ms']:>7.1f} ms{page['many_ms']:>9.1f} ms{page['ratio']:>8.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
