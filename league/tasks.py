"""Celery's side of the league: thin, every task calls one service."""

from __future__ import annotations

import logging

from celery import shared_task
from celery.signals import worker_ready
from django.utils import timezone

from . import services

logger = logging.getLogger(__name__)


@shared_task
def enter_house_cars() -> int:
    """Send the house cars to races that have opened since. Returns how many submissions were made."""
    return services.enter_house_cars(now=timezone.now()).submitted


@worker_ready.connect
def enter_house_cars_at_start(sender=None, **kwargs: object) -> None:
    """A worker that comes up looks whether the house cars are where they belong."""
    try:
        enter_house_cars.apply_async(retry=False)
    except Exception as error:  # the broker's client may raise anything; the next start or beat tries again
        logger.warning("The house cars could not be sent for: %s", error)
