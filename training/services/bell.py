"""The trainers' bell: a message that says "there may be a training to do", on a queue of its own."""

from __future__ import annotations

from django.db import transaction

from evaluation.services.bell import send

QUEUE = "training"


def ring_training_bell(*, times: int = 1) -> None:
    """Wake up to ``times`` trainers once the current transaction is committed. A broker that is down is logged and
    nothing else: the sweep rings again."""
    transaction.on_commit(lambda: _ring(times), robust=True)


def _ring(times: int) -> None:
    from ..tasks import train

    send(train, times, queue=QUEUE)
