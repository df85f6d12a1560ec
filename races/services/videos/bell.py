"""The bell of whoever draws videos: a message that says "there may be one to draw", on a queue of its own."""

from __future__ import annotations

from django.db import transaction

from evaluation.services.bell import send

QUEUE = "videos"


def ring_video_bell() -> None:
    """Wake a worker once the current transaction is committed. A broker that is down is logged and nothing else: the
    sweep rings again."""
    transaction.on_commit(_ring, robust=True)


def _ring() -> None:
    from ...tasks import draw

    send(draw, 1, queue=QUEUE)
