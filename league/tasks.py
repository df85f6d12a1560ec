"""Periodic tasks of the league."""

from celery import Task, shared_task
from celery.signals import worker_ready

from core.database.clock import database_now
from core.wakeups.workers import send

from .cups.services import run_cups
from .house_cars.services import enter_house_cars
from .invitations.services import send_invitations
from .notices.services import forget_old_notices, send_mails
from .seasons.services.clock import tick
from .stewarding.official_results import close_due_rounds
from .webhooks.deliveries import AT_ONCE, deliver_due, hosts_due
from .webhooks.services import tidy_webhooks


@shared_task
def house_cars() -> int:
    """Send the house cars to races that have opened. Returns how many submissions were made."""
    return enter_house_cars(now=database_now())


@shared_task
def clock() -> int:
    return tick(now=database_now())


@shared_task
def cups() -> int:
    return run_cups(now=database_now())


@shared_task
def close_rounds() -> int:
    return len(close_due_rounds(now=database_now()))


@shared_task(bind=True)
def notices(self: Task) -> int:
    """Send the notices and invitations that are to go by mail. Returns how many went."""
    now = database_now()
    forget_old_notices(now=now)
    worker = self.request.hostname or "local"
    return send_mails(now=now, worker=worker) + send_invitations(now=now, worker=worker)


@shared_task(bind=True)
def webhooks(self: Task) -> int:
    """Send due deliveries, several hosts at once. Returns how many this task tried."""
    now = database_now()
    tidy_webhooks(now=now)
    if (others := min(hosts_due(now=now), AT_ONCE) - 1) > 0:
        send("league.tasks.deliver", others)
    return deliver_due(now=now, worker=self.request.hostname or "local")


@shared_task(bind=True)
def deliver(self: Task) -> int:
    """Send what is due, beside other workers. Returns how many deliveries were tried."""
    return deliver_due(now=database_now(), worker=self.request.hostname or "local")


@worker_ready.connect
def house_cars_at_start(**kwargs: object) -> None:
    """A fresh installation has marks to beat from its first minute on."""
    send(house_cars.name, 1)
