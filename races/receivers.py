"""What this room does when the room below tells something."""

from __future__ import annotations

from datetime import datetime

from evaluation.models import Evaluation, Result

from .services import record_ended_duel, record_ended_evaluation, record_ended_own
from .services.redrives import drive_again_after_commit


def take_ended_evaluation(
    sender: object, *, evaluation: Evaluation, result: Result | None, now: datetime, **kwargs: object
) -> None:
    """Write the standing, or what a duel gave, in the transaction that ends the evaluation; and send the car of an own
    run to its race. A sealed run means nothing yet: all of that comes when it is unsealed."""
    if evaluation.sealed:
        return
    record_ended_evaluation(evaluation=evaluation, result=result, now=now)
    record_ended_duel(evaluation=evaluation, result=result, now=now)
    record_ended_own(evaluation=evaluation, result=result, now=now)
    drive_again_after_commit(evaluation, now)
