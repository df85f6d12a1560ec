"""The league's periodic work."""

from __future__ import annotations

import logging

from celery import shared_task
from celery.signals import worker_ready
from django.utils import timezone

from core.clock import database_now
from core.wakeup import send

from .services import close_due_rounds, enter_house_cars
from .services.clock import tick
from .services.cups import run_cups
from .services.deliveries import AT_ONCE, deliver_due, hosts_due
from .services.inviting import send_invitations
from .services.mails import send_mails
from .services.notices import forget_old_notices
from .services.webhooks import tidy_webhooks

logger = logging.getLogger(__name__)


@shared_task
def house_cars() -> int:
    """Send the house cars to races that have opened. Returns how many submissions were made."""
    return enter_house_cars(now=timezone.now()).submitted


@shared_task
def clock() -> int:
    """Write down what has happened by the passing of time. Returns how many events are new."""
    return tick(now=timezone.now())


@shared_task
def cups() -> int:
    """Take what steps of cups of the day are due. Returns how many were taken."""
    return run_cups(now=timezone.now())


@shared_task
def close_rounds() -> int:
    """Make the results of rounds official that have closed. Returns how many."""
    return len(close_due_rounds(now=timezone.now()))


@shared_task
def notices() -> int:
    """Send the notices and invitations that are to go by mail. Returns how many went."""
    now = database_now()
    forget_old_notices(now=now)
    return send_mails(now=now) + send_invitations(now=now)


@shared_task
def webhooks() -> int:
    """Tell programs and chats what is due, several hosts at once. Returns how many deliveries this one tried."""
    now = database_now()
    tidy_webhooks(now=now)
    if (others := min(hosts_due(now=now), AT_ONCE) - 1) > 0:
        send("league.tasks.deliver", others)
    return deliver_due(now=now)


@shared_task
def deliver() -> int:
    """Send what is due beside whoever else does. Returns how many deliveries were tried."""
    return deliver_due(now=database_now())


@worker_ready.connect
def house_cars_at_start(**kwargs: object) -> None:
    """A fresh installation has marks to beat from its first minute on."""
    try:
        house_cars.apply_async(retry=False, expires=60)
    except Exception:  # the broker's client may raise anything; beat sends it again
        logger.exception("The house cars could not be sent for.")
