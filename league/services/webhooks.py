"""Telling programs of organisers what happens in their races: signed, once, tried again for a while."""

from __future__ import annotations

import hashlib
import hmac
import http.client
import json
import logging
import socket
import ssl
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.core.cache import cache
from django.db import transaction
from django.db.models import F, Q, QuerySet

from evaluation.models import Evaluation, State
from evaluation.services.bell import send
from faults import UserFault
from races.models import Kind, Race

from .. import outgoing
from ..models import Racer, Webhook, WebhookDelivery

logger = logging.getLogger(__name__)
REACH = timedelta(days=3)
KEPT = timedelta(days=30)
PER_RACER = 10
TRIES = 6  # after 1, 4, 16, 64 and 256 minutes: given up after less than six hours
LEASE = timedelta(minutes=5)
AT_A_TIME = 20
OPENED, CLOSED, OFFICIAL, RESULT = "race.opened", "race.closed", "race.official", "race.result"
EVENTS = (OPENED, CLOSED, OFFICIAL, RESULT)
# asked for by the owner and tried once: whoever watches asks again
TEST = "webhook.test"
TESTS_AN_HOUR, AN_HOUR_S = 10, 3600
# what went wrong on the way, the first that fits; the page has a sentence for each
_ERRORS = (
    (socket.gaierror, "no_such_name"),
    (ConnectionRefusedError, "refused"),
    (TimeoutError, "too_slow"),
    (ssl.SSLError, "no_tls"),
    (http.client.HTTPException, "no_http"),
)


@transaction.atomic
def add_webhook(*, owner: Racer, url: str, race: Race | None = None) -> Webhook:
    """Add an address. Raises UserFault("webhook_address" | "webhook_limit" | "race_not_yours")."""
    outgoing.checked(url)
    Racer.objects.select_for_update(no_key=True).get(pk=owner.pk)
    if Webhook.objects.filter(owner=owner).count() >= PER_RACER:
        raise UserFault("webhook_limit", limit=PER_RACER)
    if race is not None and not (owner.is_staff or race.organiser_id == owner.pk):
        raise UserFault("race_not_yours")
    hook = Webhook(owner=owner, url=url, race=race)
    hook.save(force_insert=True)
    return hook


def send_test(*, webhook: Webhook, now: datetime) -> WebhookDelivery:
    """Queue a test delivery, signed as every other and sent by the same task, which is rung for at once.

    Raises UserFault("webhook_test_limit") after ten of the owner within an hour, whichever webhooks they were for.
    """
    _count_test(webhook.owner_id)
    with transaction.atomic():
        body = json.dumps({"event": TEST, "race": None, "data": {"url": webhook.url}}, separators=(",", ":"))
        queued = WebhookDelivery.objects.create(
            webhook=webhook, event=TEST, about=f"{now:%Y%m%d%H%M%S%f}", at=now, next_at=now, body=body
        )
        transaction.on_commit(_ring, robust=True)
    return queued


def queue_deliveries(*, now: datetime) -> int:
    """Write down what webhooks are to be told at ``now``, each thing once; returns how many deliveries are new.

    Nothing from before the webhook was made, and nothing older than three days.
    """
    queued = WebhookDelivery.objects.filter(at=now)  # not all there are, which grow
    before = queued.count()
    for hook in Webhook.objects.select_related("owner", "race").filter(owner__is_active=True):
        since = max(now - REACH, hook.created_at)
        rows = [
            WebhookDelivery(webhook=hook, event=event, about=about, at=now, next_at=now, body=_body(event, race, data))
            for event, about, race, data in _events(_races_of(hook), since, now)
        ]
        WebhookDelivery.objects.bulk_create(rows, ignore_conflicts=True)
    count = queued.count() - before
    WebhookDelivery.objects.filter(at__lt=now - KEPT).exclude(state="due").delete()
    return count


def deliver_due(*, now: datetime) -> int:
    """Send what is due, at most twenty; returns how many were taken. Whoever claims a delivery sends it alone."""
    due = WebhookDelivery.objects.filter(state="due", next_at__lte=now).order_by("next_at", "pk")
    taken = 0
    for pk in list(due.values_list("pk", flat=True)[:AT_A_TIME]):
        claim = WebhookDelivery.objects.filter(pk=pk, state="due", next_at__lte=now)
        if claim.update(next_at=now + LEASE, tries=F("tries") + 1):
            taken += _deliver(WebhookDelivery.objects.select_related("webhook").get(pk=pk), now)
    return taken


def signature(secret: str, body: bytes) -> str:
    """HMAC-SHA256 of a body as it stands in the header X-Paddock-Signature."""
    return "sha256=" + hmac.new(secret.encode(), body, hashlib.sha256).hexdigest()


def _deliver(delivery: WebhookDelivery, now: datetime) -> bool:
    body = delivery.body.encode()
    headers = {
        "Content-Type": "application/json",
        "User-Agent": "Paddock",
        "X-Paddock-Event": delivery.event,
        "X-Paddock-Delivery": str(delivery.pk),
        "X-Paddock-Signature": signature(delivery.webhook.secret, body),
    }
    status, error = None, ""
    try:
        status = outgoing.post(delivery.webhook.url, body, headers, allow_private=settings.WEBHOOKS_PRIVATE)
    except UserFault as fault:
        error = fault.code
    except (OSError, http.client.HTTPException) as fault:
        error = next((code for kind, code in _ERRORS if isinstance(fault, kind)), "no_connection")
    if status is not None and 200 <= status < 300:
        delivery.state = "sent"
    else:
        given_up = delivery.tries >= TRIES or delivery.event == TEST
        delivery.state = "failed" if given_up else "due"
        delivery.next_at = now + timedelta(minutes=4 ** (delivery.tries - 1))
    delivery.status, delivery.error = status, error
    delivery.save(update_fields=["state", "next_at", "status", "error"])
    return True


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


def _ring() -> None:
    """A broker that is away is logged; the periodic task takes what is due within a minute all the same."""
    from ..tasks import webhooks

    send(webhooks, 1)


def _races_of(hook: Webhook) -> QuerySet[Race]:
    """The races that a webhook may be told of, judged anew each time: who no longer organises hears no more."""
    races = Race.objects.filter(cancelled_at=None, imported_at=None)
    if not hook.owner.is_staff:
        races = races.filter(organiser=hook.owner)
    elif hook.race_id is None:
        races = races.filter(Q(organiser=hook.owner) | Q(kind=Kind.LEAGUE))
    return races if hook.race_id is None else races.filter(pk=hook.race_id)


def _events(races: QuerySet[Race], since: datetime, now: datetime) -> Iterator[tuple[str, str, Race, dict[str, Any]]]:
    for race in races.filter(opens_at__gt=since, opens_at__lte=now):
        yield OPENED, f"{race.slug}:{race.opens_at:%Y%m%d%H%M}", race, {}
    for race in races.filter(closes_at__gt=since, closes_at__lte=now):
        yield CLOSED, f"{race.slug}:{race.closes_at:%Y%m%d%H%M}", race, {}
    for race in races.filter(round__closed_at__gt=since, round__closed_at__lte=now).select_related("round"):
        yield OFFICIAL, f"{race.slug}:{race.round.closed_at:%Y%m%d%H%M%S}", race, {}
    ended = Evaluation.objects.filter(
        submission__entry__race__in=races, ended_at__gt=since, ended_at__lte=now, state=State.FINISHED
    )
    for one in ended.select_related("submission__entry__race", "submission__entry__racer").order_by("ended_at", "pk"):
        entry = one.submission.entry
        data = {
            "evaluation": one.public_id,
            "racer": entry.racer.alias,
            "is_best": entry.best_id == one.submission.pk,
            "classified": entry.classified,
            "score_ms": entry.score_ms,
            "best_lap_ms": entry.best_lap_ms,
        }
        yield RESULT, one.public_id, entry.race, data


def _body(event: str, race: Race, data: dict[str, Any]) -> str:
    told = {
        "event": event,
        "race": {
            "slug": race.slug,
            "name": race.name,
            "url": f"{settings.SITE_URL}{race.get_absolute_url()}",
            "opens_at": race.opens_at.isoformat(),
            "closes_at": race.closes_at.isoformat(),
        },
    }
    return json.dumps(told | ({"data": data} if data else {}), separators=(",", ":"))
