"""``manage.py verify``: run a finished evaluation again and compare."""

import hashlib
import json
from argparse import ArgumentParser
from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from evaluation.models import CompetitorResult, Evaluation, Result
from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome, evaluate
from evaluation.running.queue.worker import job_of
from evaluation.running.results import read_layout
from paddock.errors import PlatformFault, UserFault
from races.entries.engines import site_engine
from races.entries.selectors.lists import replaced_by

DIFFERENT, NOT_RUN = 1, 3


class Command(BaseCommand):
    """Runs from the frozen specification and the stored network; writes nothing."""

    help = (
        f"Run a finished evaluation again and compare its trace. Exit status {DIFFERENT}: it differs; {NOT_RUN}: it "
        "was not run, as what another engine drove is not."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("evaluation", help="the evaluation's id, as in its address")

    def handle(self, *, evaluation: str, **options: object) -> None:
        row = (
            Evaluation.objects.select_related("model__network", "track", "result").filter(public_id=evaluation).first()
        )
        if row is None:
            raise CommandError(f"There is no evaluation {evaluation}.", returncode=NOT_RUN)
        if not hasattr(row, "result"):
            raise CommandError(f"Evaluation {evaluation} has no result: it is {row.state}.", returncode=NOT_RUN)
        if row.result.engine != site_engine():
            raise CommandError(_of_another_engine(row), returncode=NOT_RUN)
        try:
            outcome = evaluate(job_of(row), wall_limit_s=settings.EVALUATION_WALL_SECONDS)
            differences = differing(row.result, outcome)
        except PlatformFault as fault:
            for note in getattr(fault, "__notes__", ()):
                self.stderr.write(note)
            raise CommandError(f"{fault.code}: {fault}", returncode=NOT_RUN) from fault
        except UserFault as fault:
            raise CommandError(
                f"Different: it finished then, and now ends with {fault.code}: {fault}", returncode=DIFFERENT
            ) from fault
        for name, (stored, measured) in differences.items():
            self.stdout.write(f"{name}: was {stored}, is {measured}")
        if row.result.cpu_model != outcome.cpu_model:
            self.stdout.write(f"(processor: was {row.result.cpu_model}, is {outcome.cpu_model})")
        if differences:
            raise CommandError(
                f"Evaluation {evaluation} is different: both runs are of the engine {outcome.engine}.",
                returncode=DIFFERENT,
            )
        self.stdout.write(f"Evaluation {evaluation} is the same: engine {outcome.engine}, trace {outcome.trace_sha256}")


def _of_another_engine(evaluation: Evaluation) -> str:
    """Both engines, and for a run of a race which run counts there since that was driven again."""
    message = (
        f"Evaluation {evaluation} is of the engine {evaluation.result.engine}, and this site drives with "
        f"{site_engine()}: two engines are not compared, so it was not run again."
    )
    again = replaced_by(evaluation)
    return f"{message} In its race {again.evaluation} counts since, of {again.engine}." if again else message


def differing(result: Result, outcome: EvaluationOutcome) -> dict[str, tuple[Any, Any]]:
    """The differences by name: the stored value and the measured one. Raises PlatformFault("storage_failed")."""
    pairs: dict[str, tuple[Any, Any]] = {}
    rivals = {rival.number: rival for rival in result.rivals.all()}
    pairs |= _car_pairs("", result, outcome)
    for number, car in enumerate(outcome.rivals, 1):
        pairs |= _car_pairs(f"car {number}: ", rivals[number], car)
    if rivals:
        pairs["order of the cars"] = (result.order, outcome.order)
    layout, driven = read_layout(result), {"boxes": [], "bots": []} | outcome.layout
    pairs["boxes"] = (layout["boxes"], driven["boxes"])
    pairs["bot cars"] = (_digest(layout["bots"]), _digest(driven["bots"]))
    for library in sorted({*result.versions, *outcome.versions}):
        pairs[f"version of {library}"] = (result.versions.get(library), outcome.versions.get(library))
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _car_pairs(
    prefix: str, stored: CompetitorResult, car: EvaluationOutcome | CompetitorOutcome
) -> dict[str, tuple[Any, Any]]:
    return {
        f"{prefix}trace_sha256": (stored.trace_sha256, car.trace_sha256),
        f"{prefix}lap times (ms)": ([lap["time_ms"] for lap in stored.laps], [lap["time_ms"] for lap in car.laps]),
        f"{prefix}reason for ending": (stored.end_reason, car.end_reason),
        f"{prefix}reason for retiring": (stored.retired_code, car.retired["code"] if car.retired else ""),
    }


def _digest(bots: list) -> str:
    """A short name for where all bot cars were at every step; a reader could not compare the poses themselves."""
    return hashlib.sha256(json.dumps(bots, separators=(",", ":")).encode()).hexdigest()[:12] if bots else "none"
