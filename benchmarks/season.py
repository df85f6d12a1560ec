"""``python -m benchmarks.season [--json]``: how long a recorded season takes to come in, as seasons grow.

Seasons of one shape and several sizes, made up in the form of the record, the largest as large as a real one. Each is
read, checked, written, and worked out round after round, in a transaction that is then taken back. ``--folder``
measures a recorded season of your own besides. Runs on a SQLite database of its own, or with ``--postgres`` on a
PostgreSQL server of its own.
"""

from __future__ import annotations

import csv
import os
import random
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .board import database, numbers
from .report import command, report

RESULTS = (4_000, 12_000, 36_000)
MONTHS = 9
IMPORT_S, GROWTH = (
    60.0,
    1.5,
)  # what is promised: seconds of a season, and of a result of the largest by one of the first
_STAGES = {"open-qualifier": 0.93, "pro-qualifier": 0.06, "pro-finale": 0.01}  # of a month's results


def make_folder(folder: Path, results: int) -> Path:
    """Write a season with about so many results as ``import_season`` reads it; the same for the same number."""
    from league.history.columns import RACE_COLUMNS

    chance = random.Random(results)
    (folder / "results").mkdir(parents=True)
    rows = []
    for month in range(1, MONTHS + 1):
        for stage, share in _STAGES.items():
            count = max(16, round(share * results / MONTHS)) if stage != "pro-finale" else 16
            file = f"results/{month:02}-{stage}.csv"
            _write_results(folder / file, count, results, chance, month)
            rows.append(_race(file, stage, month, count))
    _write(folder / "races.csv", RACE_COLUMNS, rows)
    return folder


def _race(file: str, stage: str, month: int, count: int) -> dict[str, Any]:
    from league.history.columns import LAPS_COLUMNS

    finale = stage == "pro-finale"
    opens = datetime(2031, month + finale, 10 if finale else 1, tzinfo=UTC)
    closes = datetime(2031, month + 1, 11 if finale else 1, tzinfo=UTC)
    return {
        **{"file": file, "season": "2031", "name": f"Month {month}", "stage": stage, "division": stage.split("-")[0]},
        **{"race_type": "time_trial", "timing_method": "total_time", **dict.fromkeys(LAPS_COLUMNS, 3)},
        **{"opens": opens.isoformat(), "closes": closes.isoformat(), "track": "somewhere", "racers": count},
    }


def _write_results(path: Path, count: int, racers: int, chance: random.Random, month: int) -> None:
    from league.history.columns import RESULT_COLUMNS

    sent = int(datetime(2031, month, 2, tzinfo=UTC).timestamp()) * 1000
    scores = sorted(chance.randint(20_000, 300_000) for _ in range(count))
    rows = []
    for rank, (score, racer) in enumerate(zip(scores, chance.sample(range(racers), count), strict=True), start=1):
        name = f"racer-{racer:06}"
        values = (name, sent + rank, 3, score // 3, score // 3 - 9, score, 0.0, 0, 1, 1, 2, rank, "SUCCESS", score)
        rows.append(dict(zip(RESULT_COLUMNS, (*values, "OPEN", name), strict=True)))
    _write(path, RESULT_COLUMNS, rows)


def _write(path: Path, heading: Any, rows: list[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(heading), restval="")
        writer.writeheader()
        writer.writerows(rows)


def measure(results: tuple[int, ...], folder: Path | None = None) -> dict[str, Any]:
    """Seconds of the clock and of the processor of each import. Django is set up on an empty database."""
    from django.db import connection

    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="paddock-season-") as place:
        sizes = enumerate((results[0], *results))  # the first warms up
        made = [_import(make_folder(Path(place) / str(number), size)) for number, size in sizes][1:]
    found: dict[str, Any] = {"database": connection.vendor, "made_up": made}
    found["growth"] = _each(made[-1]) / _each(made[0])
    found["recorded"] = None if folder is None else _import(folder)
    found["machine"] = {"cores": len(os.sched_getaffinity(0)), "load": [load, os.getloadavg()[0]]}
    return found


def _each(figures: dict[str, Any]) -> float:
    return figures["processor_s"] / figures["results"]


def _import(folder: Path) -> dict[str, Any]:
    from django.db import transaction
    from django.utils import timezone

    from league.history.season_import import import_folder
    from races.models import Entry, Race

    began, processor = time.perf_counter(), time.process_time()
    with transaction.atomic():
        import_folder(folder=folder, now=timezone.now())
        seconds, processor = time.perf_counter() - began, time.process_time() - processor
        figures = {"results": Entry.objects.count(), "races": Race.objects.count()}
        transaction.set_rollback(True)
    return figures | {"seconds": seconds, "processor_s": processor}


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    all_ = [*figures["made_up"], *([figures["recorded"]] if figures["recorded"] else [])]
    found = [f"{one['results']:,} results took {one['seconds']:.0f} s" for one in all_ if one["seconds"] > IMPORT_S]
    if figures["growth"] > GROWTH:
        found.append(f"a result of the largest season costs {figures['growth']:.2f} times that of the smallest")
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    named = [("made up", one) for one in figures["made_up"]]
    named += [("recorded", figures["recorded"])] if figures["recorded"] else []
    lines = [
        f"{name:10}{one['results']:>8,} results of {one['races']} races: {one['seconds']:6.1f} s, "
        f"{one['processor_s']:6.1f} s of the processor"
        for name, one in named
    ]
    return "\n".join([f"{figures['database']}, growth {figures['growth']:.2f}", *lines])


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = command("season", "What importing a season costs.")
    parser.add_argument("--results", type=numbers, default=RESULTS, help="results of the seasons made up")
    parser.add_argument("--folder", type=Path, help="a recorded season of your own")
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server that is started for it")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.results, options.folder)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
