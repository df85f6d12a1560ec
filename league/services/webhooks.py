"""What programs of racers and organisers are to be told: whom, of what, each thing once."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime, timedelta

from django.conf import settings
from django.core.cache import cache
from django.db import transaction
from django.db.models import Q, QuerySet
from django.utils import translation

from accounts.models import Racer
from core.events import Event, EventReader
from core.wakeup import wake
from paddock.errors import UserFault
from races.events import RACE_TIMED
from races.models import Entry, Race, RaceKind

from .. import chats, outgoing
from ..happenings import EVENTS, KINDS, OF_RACER, TEST, Happening, happening
from ..models import Webhook, WebhookDelivery
from ..models.webhook import new_secret
from .notices import choice_of

REACH = timedelta(days=3)
KEPT = timedelta(days=30)
PER_RACER = 10
OLD_SECRET = timedelta(days=1)  # for so long the secret before signs as well
TESTS_AN_HOUR, AN_HOUR_S = 10, 3600


@transaction.atomic
def add_webhook(*, owner: Racer, url: str, race: Race | None = None, events: Sequence[str] = ()) -> Webhook:
    """Add an address that is told ``events``, all of them if none is named.

    Raises UserFault("webhook_address" | "webhook_event" | "webhook_limit" | "race_not_yours").
    """
    outgoing.checked(url)
    if unknown := sorted(set(events) - set(EVENTS)):
        raise UserFault("webhook_event", event=unknown[0], known=", ".join(EVENTS))
    Racer.objects.select_for_update(no_key=True).get(pk=owner.pk)
    if Webhook.objects.filter(owner=owner).count() >= PER_RACER:
        raise UserFault("webhook_limit", limit=PER_RACER)
    if race is not None and not _may_hear_of(owner, race):
        raise UserFault("race_not_yours")
    named = [event for event in EVENTS if event in events]
    host = outgoing.host_of(url)
    hook = Webhook(owner=owner, url=url, host=host, race=race, events=[] if len(named) == len(EVENTS) else named)
    hook.save(force_insert=True)
    return hook


def remove_webhook(*, webhook: Webhook) -> None:
    """Take an address away: it is told nothing more, also not what waits."""
    webhook.delete()


@transaction.atomic
def change_secret(*, webhook: Webhook, now: datetime) -> Webhook:
    """Make a new secret. For a day the one before signs as well, so that no delivery fails while a program is changed;
    one before that signs no more."""
    hook = Webhook.objects.select_for_update().get(pk=webhook.pk)
    hook.old_secret, hook.old_secret_until, hook.secret = hook.secret, now + OLD_SECRET, new_secret()
    hook.save(update_fields=["secret", "old_secret", "old_secret_until"])
    return hook


def send_test(*, webhook: Webhook, now: datetime) -> WebhookDelivery:
    """Queue a test delivery, signed as every other and sent by the same task, which is woken at once.

    Raises UserFault("webhook_test_limit") after ten of the owner within an hour, whichever webhooks they were for.
    """
    _count_test(webhook.owner_id)
    with transaction.atomic():
        # tried once: whoever watches asks again
        test = Happening(TEST, f"{now:%Y%m%d%H%M%S%f}", now, "/settings/webhooks/", data={"url": webhook.url})
        queued = _delivery(webhook, test, now)
        queued.save(force_insert=True)
        # a broker that is away is logged; the periodic task takes what is due within a minute all the same
        wake("league.tasks.webhooks")
    return queued


def queue_deliveries(event: Event, now: datetime) -> int:
    """Write down what webhooks are to be told of an event, each thing once; returns how many deliveries are new.

    Nothing from before the webhook was made, and nothing older than three days.
    """
    one = happening(event)
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


# Writes deliveries; told is how many.
WEBHOOKS = EventReader("webhooks", (*KINDS, RACE_TIMED), queue_deliveries)


def tidy_webhooks(*, now: datetime) -> int:
    """Delete what was told more than a month ago; give webhooks that know none their host. Returns how many deliveries
    went."""
    for hook in Webhook.objects.all():
        host = outgoing.host_of(hook.url)
        if hook.host != host:  # made by a version that knew no hosts, or no ports of them
            Webhook.objects.filter(pk=hook.pk).update(host=host)
    return WebhookDelivery.objects.filter(at__lt=now - KEPT, state__in=("sent", "failed")).delete()[0]


def secrets_of(hook: Webhook, now: datetime) -> list[str]:
    """What signs at ``now``: the secret, and for a day after it was changed the one before."""
    keeps_old = hook.old_secret_until is not None and now < hook.old_secret_until
    return [hook.secret, hook.old_secret] if keeps_old else [hook.secret]


def _hooks_for(one: Happening, event: Event) -> QuerySet[Webhook]:
    """The webhooks that may be told, judged anew each time: who no longer organises a race hears no more of it."""
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


def _may_hear_of(racer: Racer, race: Race) -> bool:
    """Whether one may ask to be told of this race: its organiser, who is in it, and admins."""
    if racer.is_staff or race.organiser_id == racer.pk:
        return True
    return Entry.objects.filter(race=race, racer=racer, withdrawn_at=None).exists()


def _delivery(hook: Webhook, one: Happening, now: datetime) -> WebhookDelivery:
    chat = chats.chat_of(hook.url)
    if chat is None:
        body = json.dumps(one.body(), separators=(",", ":"))
    else:
        with translation.override(choice_of(hook.owner).language):
            body = chats.message(chat, one.words(), f"{settings.SITE_URL}{one.path}").decode()
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
