"""Writes of webhooks: adding, changing, removing, and queuing an event's deliveries."""

import json
from collections.abc import Sequence
from datetime import datetime, timedelta

from django.conf import settings
from django.core.cache import cache
from django.db import transaction
from django.db.models import Q, QuerySet
from django.utils import translation
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.events import Event, EventReader
from core.wakeups.workers import wake
from paddock.errors import UserFault
from races.events import RACE_TIMED
from races.models import Race, RaceKind

from ..models import Webhook, WebhookDelivery
from ..models.webhook import new_secret
from ..notices.services import choice_of
from . import outgoing_requests as outgoing
from .payloads import EVENTS, KINDS, OF_RACER, PAYLOADS, TEST, Happening, chat_message, chat_of
from .selectors import races_for_webhooks

REACH = timedelta(days=3)
PER_RACER = 10
OLD_SECRET = timedelta(days=1)  # for so long the secret before signs as well
TESTS_AN_HOUR, AN_HOUR_S = 10, 3600


def refuse_undeliverable(url: str) -> None:
    """As :func:`.outgoing_requests.refuse_undeliverable`, by the site's setting of private addresses."""
    outgoing.refuse_undeliverable(url, allow_private=settings.WEBHOOKS_PRIVATE)


def add_webhook(
    *,
    owner: Racer,
    url: str,
    race: Race | None = None,
    events: Sequence[str] = (),
    is_deliverable: bool = False,
) -> Webhook:
    """Add an address for ``events`` (none: all). ``is_deliverable``: :func:`refuse_undeliverable` was called already.

    Raises UserFault("webhook_event" | "webhook_limit" | "race_not_yours"), and what :func:`refuse_undeliverable` does.
    """
    if not is_deliverable:
        refuse_undeliverable(url)
    return _add_webhook(owner, url, race, events)


@audited("webhook.added", _("Webhook added"), by="owner")
@transaction.atomic
def _add_webhook(owner: Racer, url: str, race: Race | None, events: Sequence[str]) -> Webhook:
    if unknown := sorted(set(events) - set(EVENTS)):
        raise UserFault("webhook_event", event=unknown[0], known=", ".join(EVENTS))
    Racer.objects.select_for_update(no_key=True).get(pk=owner.pk)
    if Webhook.objects.filter(owner=owner).count() >= PER_RACER:
        raise UserFault("webhook_limit", limit=PER_RACER)
    if race is not None and not (owner.is_staff or races_for_webhooks(owner).filter(pk=race.pk).exists()):
        raise UserFault("race_not_yours")
    named = [event for event in EVENTS if event in events]
    host = outgoing.host_of(url)
    hook = Webhook(owner=owner, url=url, host=host, race=race, events=[] if len(named) == len(EVENTS) else named)
    hook.save(force_insert=True)
    return hook


@audited("webhook.removed", _("Webhook removed"), target="webhook")
def remove_webhook(*, webhook: Webhook) -> None:
    webhook.delete()


@audited("webhook.secret_replaced", _("Webhook's secret replaced"), target="webhook")
@transaction.atomic
def change_secret(*, webhook: Webhook, now: datetime) -> Webhook:
    """Make a new secret; the previous one signs too for a day, one before that no more."""
    hook = Webhook.objects.select_for_update().get(pk=webhook.pk)
    hook.old_secret, hook.old_secret_until, hook.secret = hook.secret, now + OLD_SECRET, new_secret()
    hook.save(update_fields=["secret", "old_secret", "old_secret_until"])
    return hook


def send_test(*, webhook: Webhook, now: datetime) -> WebhookDelivery:
    """Queue a test delivery and wake its task. Raises UserFault("webhook_test_limit") after ten in an hour."""
    _count_test(webhook.owner_id)
    with transaction.atomic():
        # tried once: the owner watches and tries again
        test = Happening(TEST, f"{now:%Y%m%d%H%M%S%f}", now, "/settings/webhooks/", data={"url": webhook.url})
        queued = _delivery(webhook, test, now)
        queued.save(force_insert=True)
        # a broker that is away is logged; the periodic task takes what is due within a minute all the same
        wake("league.tasks.webhooks")
    return queued


def queue_deliveries(event: Event, now: datetime) -> int:
    """Queue an event of the last three days for the webhooks that receive it, once each; returns how many are new."""
    one = PAYLOADS[event.kind](event)
    if one is None:
        return 0
    queued = 0
    for hook in _hooks_for(one, event):
        known = WebhookDelivery.objects.filter(webhook=hook, event=one.event, about=one.about)
        if one.event in (hook.events or EVENTS) and max(now - REACH, hook.created_at) < one.at and not known.exists():
            _delivery(hook, one, now).save(force_insert=True)
            queued += 1
    if queued:
        wake("league.tasks.webhooks")
    return queued


# The reader returns how many deliveries it queued.
WEBHOOKS = EventReader("webhooks", (*KINDS, RACE_TIMED), queue_deliveries)


def tidy_webhooks(*, now: datetime) -> int:
    """Delete deliveries older than ``WEBHOOK_DELIVERIES_KEPT_DAYS``, and set missing hosts. Returns how many
    deliveries were deleted."""
    for hook in Webhook.objects.all():
        host = outgoing.host_of(hook.url)
        if hook.host != host:  # made by a version that knew no hosts, or no ports of them
            Webhook.objects.filter(pk=hook.pk).update(host=host)
    days = settings.WEBHOOK_DELIVERIES_KEPT_DAYS
    old = WebhookDelivery.objects.filter(at__lt=now - timedelta(days=days), state__in=("sent", "failed"))
    return old.delete()[0] if days else 0


def secrets_of(hook: Webhook, now: datetime) -> list[str]:
    """What signs at ``now``: the secret, and for a day after it was changed the one before."""
    keeps_old = hook.old_secret_until is not None and now < hook.old_secret_until
    return [hook.secret, hook.old_secret] if keeps_old else [hook.secret]


def _hooks_for(one: Happening, event: Event) -> QuerySet[Webhook]:
    """The webhooks that receive an event; former organisers of its race no longer do."""
    hooks = Webhook.objects.select_related("owner", "race").filter(owner__is_active=True).order_by("pk")
    hooks = hooks.filter(Q(race=None) | Q(race=one.race))
    if one.event in OF_RACER:
        return hooks.filter(owner=event.racer_id)
    race = one.race
    if race is None:
        return hooks.none()
    whose = Q(owner__is_staff=True, race=race)
    if race.kind == RaceKind.LEAGUE:
        whose |= Q(owner__is_staff=True)
    return hooks.filter(whose if race.organiser_id is None else whose | Q(owner=race.organiser_id))


def _delivery(hook: Webhook, one: Happening, now: datetime) -> WebhookDelivery:
    chat = chat_of(hook.url)
    if chat is None:
        body = json.dumps(one.body(), separators=(",", ":"))
    else:
        with translation.override(choice_of(hook.owner).language):
            body = chat_message(chat, one.words(), f"{settings.SITE_URL}{one.path}").decode()
    return WebhookDelivery(webhook=hook, event=one.event, about=one.about, at=now, not_before=now, body=body)


def _count_test(owner: int) -> None:
    """Kept beside the rows, which go with a webhook that is removed."""
    key = f"webhook-tests-{owner}"
    cache.add(key, 0, AN_HOUR_S)
    try:
        sent = cache.incr(key)
    except ValueError:  # its hour ended between the two
        sent = 1
    if sent > TESTS_AN_HOUR:
        raise UserFault("webhook_test_limit", limit=TESTS_AN_HOUR)


def drop_webhooks(sender: object, *, racer: Racer, **kwargs: object) -> None:
    """Delete the webhooks of an account that was taken over: another person may have made them."""
    Webhook.objects.filter(owner=racer).delete()
