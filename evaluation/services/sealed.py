"""Runs that are computed before they are shown: unsealed once, or thrown away unseen."""

from __future__ import annotations

from datetime import datetime

from django.db import transaction

from ..models import Evaluation, Result
from .jobs import tell_end
from .queue import stop_evaluation
from .results import delete_evaluation


@transaction.atomic
def unseal_evaluation(*, evaluation: Evaluation, now: datetime) -> bool:
    """Let a sealed run that has ended be what every other run is, and tell its end. False when it was unsealed before.

    Raises ValueError for one that waits or runs.
    """
    if not evaluation.is_final:
        raise ValueError("a sealed run that has not ended cannot be told")
    if not Evaluation.with_sealed.filter(pk=evaluation.pk, sealed=True).update(sealed=False):
        return False
    evaluation.sealed = False
    tell_end(evaluation.pk, Result.with_sealed.filter(evaluation=evaluation).first(), now)
    return True


@transaction.atomic
def discard_sealed(*, evaluation: Evaluation, now: datetime) -> bool:
    """Throw a sealed run away, whether it waits, runs or has ended: as if it had never been. False when it is not
    sealed any more. Nothing may refer to it."""
    found = Evaluation.with_sealed.select_for_update().filter(pk=evaluation.pk, sealed=True).first()
    if found is None:
        return False
    stop_evaluation(evaluation=found, now=now)
    delete_evaluation(evaluation=found)
    return True
