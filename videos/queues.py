"""Videos as the operators' page sees them."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

from core.jobs.queues import Queue, register_queue

from .services import VIDEOS, draw_again


def register() -> None:
    """Register them."""
    register_queue(
        Queue(
            *("videos", _("Videos"), VIDEOS),
            since="asked_at",
            related=("asked_by", "evaluation__track"),
            repeatable=lambda failed: failed,
            run_again=lambda video, now: draw_again(video=video, now=now),
        )
    )
