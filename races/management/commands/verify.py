"""``manage.py verify``: run a finished evaluation again and compare."""

from argparse import ArgumentParser

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError

from evaluation.models import Evaluation
from evaluation.running.pipeline import evaluate
from evaluation.running.queue.worker import job_of
from paddock.errors import PlatformFault, UserFault
from races.entries.engines import site_engine
from races.entries.selectors.lists import replaced_by
from races.rechecks.comparison import differing

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
