"""``python -m benchmarks.queue [--json]``: what the queue costs as it grows, in milliseconds of the processor.

With the time of PostgreSQL's process, the median of all runs.

The place and the expected wait of the car in front and of the last one (each waiting page asks every second), a claim,
a car that is queued, and a sweep. What waits belongs to a hundred racers in one queue, and to a racer each in the
other: turns by the thousand, and one turn for all. Runs on a SQLite database of its own, or with ``--postgres`` on a
PostgreSQL server of its own.
"""

from __future__ import annotations

import os
import statistics
import sys
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

from .board import database, numbers, oval, processor_clock
from .board_rows import insert, make_racers, series
from .report import command, report

SIZES = (1_000, 100_000)
LIMIT_MS, RATIO = 5.0, 3.0  # what is promised: of each look and claim, and of the longest queue by the shortest
FEW = 100


def measure(sizes: tuple[int, ...], runs: int) -> dict[str, Any]:
    """Milliseconds of the processor for everything, for each size in order, and the last by the first. Django is
    set up on an empty database."""
    from django.db import connection
    from django.utils import timezone

    load, now = os.getloadavg()[0], timezone.now()
    make_racers(max(sizes), now)
    track = oval()
    found: dict[str, Any] = {"sizes": list(sizes), "database": connection.vendor, "looks": {}}
    for name, racers in (("few", FEW), ("many", None)):
        for size in sizes:
            fill(size, racers or size, track, now)
            for look, ms in _looks(runs, now).items():
                found["looks"].setdefault(f"{look}, {name} racers", {"ms": []})["ms"].append(ms)
    for look in found["looks"].values():
        look["ratio"] = look["ms"][-1] / look["ms"][0]
    found["machine"] = {"cores": len(os.sched_getaffinity(0)), "load": [load, os.getloadavg()[0]]}
    return found


def fill(count: int, racers: int, track: Any, now: datetime) -> None:
    """A queue of ``count``, of racers who have waited in turns; as many have run before."""
    from django.db import connection

    from accounts.models import Racer
    from evaluation.models import Evaluation, State
    from tests.rows import model_row

    Evaluation.objects.all().delete()
    first = Racer.objects.filter(alias="r0").values_list("pk", flat=True).get()
    model = Racer.objects.get(pk=first).models.first() or model_row(Racer.objects.get(pk=first))
    fixed = {"model": model.pk, "track": track.pk, "spec": {}, "queued_at": now}
    shared = {"owner": f"{first} + n % {racers}"}
    for state, turn, times in (
        (State.FINISHED, 0, {"started_at": now - timedelta(minutes=1), "ended_at": now}),
        (State.QUEUED, count, {}),
    ):
        values = shared | {"public_id": f"'{state[0]}' || n", "turn": f"{turn} + n / {racers}"}
        insert(Evaluation, values, fixed | {"state": state, **times}, f"({series(count)}) AS numbers")
    with connection.cursor() as cursor:
        cursor.execute("VACUUM ANALYZE evaluation_evaluation" if connection.vendor == "postgresql" else "ANALYZE")


def _looks(runs: int, now: datetime) -> dict[str, float]:
    from django.db import transaction

    from evaluation.running.queue import selectors
    from evaluation.running.queue.jobs import EVALUATIONS
    from evaluation.running.queue.order import ORDER, queued
    from evaluation.running.queue.services import queue_evaluation
    from paddock.rules.race import RaceRules

    front, last = queued().order_by(*ORDER)[0], queued().order_by(*ORDER).reverse()[0]
    last.model = _of(last.owner, last.model)

    def look(evaluation: Any) -> None:
        selectors.expected_wait_s(evaluation, selectors.queue_position(evaluation))
        selectors.queue_length()

    def claim() -> None:
        assert EVALUATIONS.claim(worker="bench", now=now) is not None

    def submit() -> None:
        queue_evaluation(owner=last.owner, model=last.model, track=last.track, rules=RaceRules(), now=now)

    found, clock = {}, processor_clock()
    timed: dict[str, Callable[[], object]] = {
        "place of the first": lambda: look(front),
        "place of the last": lambda: look(last),
        "sweep": lambda: EVALUATIONS.sweep(now=now),
        "claim": claim,
        "submission": submit,
    }
    for name, call in timed.items():
        with transaction.atomic():  # taken back, and no disk in the figures
            call()
            found[name] = statistics.median(_ms(call, clock) for _ in range(runs))
            transaction.set_rollback(True)
    return found


def _of(racer: Any, model: Any) -> Any:
    from tests.rows import model_row

    return model if model.owner_id == racer.pk else racer.models.first() or model_row(racer)


def _ms(call: Callable[[], object], clock: Callable[[], float]) -> float:
    began = clock()
    call()
    return (clock() - began) * 1000


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    longest = f"{figures['sizes'][-1]:,} waiting"
    found = []
    for name, look in figures["looks"].items():
        if look["ms"][-1] > LIMIT_MS:
            found.append(f"{name}: {look['ms'][-1]:.1f} ms at {longest}")
        if look["ratio"] > RATIO:
            found.append(f"{name}: {look['ratio']:.2f} times from {figures['sizes'][0]:,} to {longest}")
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    lines = [f"{figures['database']:34}" + "".join(f"{size:>14,}" for size in figures["sizes"]) + f"{'ratio':>8}"]
    for name, look in figures["looks"].items():
        lines.append(f"{name:34}" + "".join(f"{ms:>11.2f} ms" for ms in look["ms"]) + f"{look['ratio']:>8.2f}")
    before, after = figures["machine"]["load"]
    lines.append(f"{figures['machine']['cores']} cores, load {before:.1f} before and {after:.1f} after")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Set up a database, measure, print; 1 when a promise is not kept."""
    parser = command("queue", "What the queue costs as it grows.")
    parser.add_argument("--sizes", type=numbers, default=SIZES, help="evaluations that wait, the fewest first")
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--postgres", action="store_true", help="on a PostgreSQL server that is started for it")
    options = parser.parse_args(arguments)
    with database(options.postgres):
        figures = measure(options.sizes, options.runs)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
