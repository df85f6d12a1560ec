"""``manage.py verify``: run a finished evaluation again and compare."""

from __future__ import annotations

from argparse import ArgumentParser
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from evaluation.models import Evaluation, Result
from evaluation.pipeline import EvaluationOutcome, evaluate
from evaluation.services import job_of
from faults import PlatformFault, UserFault

DIFFERENT, OUR_FAULT = 1, 3


class Command(BaseCommand):
    """Runs from the frozen specification and the stored network; writes nothing."""

    help = f"Run a finished evaluation again and compare its trace. Exit status {DIFFERENT}: it differs."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("evaluation", help="the evaluation's id, as in its address")

    def handle(self, *, evaluation: str, **options: object) -> None:
        row = (
            Evaluation.objects.select_related("model__network", "track", "result").filter(public_id=evaluation).first()
        )
        if row is None:
            raise CommandError(f"There is no evaluation {evaluation}.", returncode=OUR_FAULT)
        if not hasattr(row, "result"):
            raise CommandError(f"Evaluation {evaluation} has no result: it is {row.state}.", returncode=OUR_FAULT)
        try:
            outcome = evaluate(job_of(row), wall_limit_s=settings.EVALUATION_WALL_SECONDS)
        except PlatformFault as fault:
            for note in getattr(fault, "__notes__", ()):
                self.stderr.write(note)
            raise CommandError(f"{fault.code}: {fault}", returncode=OUR_FAULT) from fault
        except UserFault as fault:
            raise CommandError(
                f"Different: it finished then, and now ends with {fault.code}: {fault}", returncode=DIFFERENT
            ) from fault
        differences = differing(row.result, outcome)
        for name, (stored, measured) in differences.items():
            self.stdout.write(f"{name}: was {stored}, is {measured}")
        if row.result.cpu_model != outcome.cpu_model:
            self.stdout.write(f"(processor: was {row.result.cpu_model}, is {outcome.cpu_model})")
        if differences:
            raise CommandError(f"Evaluation {evaluation} is different.", returncode=DIFFERENT)
        self.stdout.write(f"Evaluation {evaluation} is the same: trace {outcome.trace_sha256}")


def differing(result: Result, outcome: EvaluationOutcome) -> dict[str, tuple[Any, Any]]:
    """What is not as it was, by name: the stored value and the measured one."""
    pairs: dict[str, tuple[Any, Any]] = {
        "engine": (result.engine, outcome.engine),
        "trace_sha256": (result.trace_sha256, outcome.trace_sha256),
        "lap times (ms)": ([lap["time_ms"] for lap in result.laps], [lap["time_ms"] for lap in outcome.laps]),
        "ended because": (result.end_reason, outcome.end_reason),
    }
    for library in sorted({*result.versions, *outcome.versions}):
        pairs[f"version of {library}"] = (result.versions.get(library), outcome.versions.get(library))
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
