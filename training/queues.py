"""Trainings as the operators' page sees them."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

from core.jobs.queues import Queue, register_queue

from .services import TRAININGS, train_again


def register() -> None:
    """Register them. One that left a model all the same is not run again: its owner goes on from that model."""
    register_queue(
        Queue(
            *("trainings", _("Trainings"), TRAININGS),
            since="created_at",
            related=("owner", "track"),
            repeatable=lambda failed: failed.filter(best_model=None, last_model=None),
            run_again=lambda job, now: train_again(job=job),
        )
    )
