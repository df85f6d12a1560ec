"""``manage.py workers``: lists the workers, and pauses, drains or resumes them."""

from argparse import ArgumentParser
from json import dumps
from typing import Any, TypedDict

from config.operations.workers import WorkerNow, workers_at
from core.database.clock import database_now
from core.management.base import JsonCommand
from evaluation.running.worker_nodes import ALL, ORDERS, RESUME, order_workers


class Command(JsonCommand):
    help = (
        "List the workers, or change them: a paused worker claims no new job and goes on with what it runs; a drained "
        "one exits after that."
    )
    requires_system_checks = []

    def add_arguments(self, parser: ArgumentParser) -> None:
        change = parser.add_mutually_exclusive_group()
        for order in (*ORDERS, RESUME):
            change.add_argument(
                f"--{order}", nargs="+", metavar="NAME", help=f"{order} these workers; {ALL}: every worker of the list"
            )
        parser.add_argument("--json", action="store_true", help="print the list as JSON")

    def handle(self, *, json: bool, **options: Any) -> None:
        now = database_now()
        for order in (*ORDERS, RESUME):
            if options[order]:
                order_workers(names=options[order], order=order, now=now)
        rows = [_row(one) for one in workers_at(now)]
        if json:
            self.stdout.write(dumps({"workers": rows}, indent=2))
            return
        shown = [(row["name"], row["machine"], row["state"]) for row in rows]
        widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
        for row, texts in zip(rows, shown, strict=True):
            name, machine, state = (text.ljust(width) for text, width in zip(texts, widths, strict=True))
            runs = ", ".join(row["runs"]) or "idle"
            self.stdout.write(
                f"{name}  {machine}  {state}  {', '.join(row['queues'])}  up since {row['since']}  {runs}"
            )
        if not rows:
            self.stdout.write("No worker was heard of within two days.")


class WorkerDocument(TypedDict):
    name: str
    machine: str
    state: str
    queues: list[str]
    since: str | None
    held_since: str | None
    runs: list[str]


def _row(one: WorkerNow) -> WorkerDocument:
    since, held = one.node.started_at, one.hold
    return {
        "name": one.node.name,
        "machine": one.machine,
        "state": one.state,
        "queues": one.node.queues,
        "since": since.isoformat(timespec="seconds") if since else None,
        "held_since": held.since.isoformat(timespec="seconds") if held else None,
        "runs": [f"{queue.name} {job}" for queue, job in one.jobs],
    }
