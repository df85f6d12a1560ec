"""Receivers of the lower room's signals."""

from datetime import datetime

from evaluation.models import Evaluation, Result

from .duels.services import record_ended_duel
from .entries.services.redrives import drive_again_after_commit
from .entries.services.standings import record_ended_evaluation
from .test_runs.services import record_ended_own


def take_ended_evaluation(
    sender: object, *, evaluation: Evaluation, result: Result | None, now: datetime, **kwargs: object
) -> None:
    """Write the result of an ended evaluation in its transaction; of a sealed run when it is unsealed."""
    if evaluation.sealed:
        return
    if record_ended_evaluation(evaluation=evaluation, result=result, now=now) is not None:
        return  # a submission's evaluation is nothing else: most are, and the questions below cost as much again
    record_ended_duel(evaluation=evaluation, result=result, now=now)
    record_ended_own(evaluation=evaluation, result=result, now=now)
    drive_again_after_commit(evaluation, now)
