"""Deliveries to webhooks: signed, one at a time to each host, with retries and growing pauses for unreachable hosts."""

import hashlib
import hmac
import http.client
import socket
import ssl
from base64 import b64decode, b64encode
from collections.abc import Iterable
from datetime import datetime, timedelta
from time import monotonic

from django.conf import settings
from django.db.models import Case, Exists, F, OuterRef, Q, QuerySet, Subquery, Value, When
from django.db.models.functions import Coalesce

from core.jobs.kinds import JobKind, register
from paddock.errors import UserFault

from ..models import WebhookDelivery, WebhookHost
from . import outgoing_requests as outgoing
from .payloads import TEST, chat_of
from .services import secrets_of

TRIES = 6  # after 1, 4, 16, 64 and 256 minutes: given up after less than six hours
LEASE = timedelta(minutes=5)
HOST_LEASE = timedelta(seconds=30)  # longer than any delivery takes
LONGEST_PAUSE = timedelta(minutes=64)
GIVEN_UP_AFTER = timedelta(hours=12)  # what waited for so long for a host that is away
AT_A_TIME, TURN_S = 20, 60.0
AT_ONCE = 8
# what went wrong on the way, the first that fits; the page has a sentence for each
_ERRORS = (
    (socket.gaierror, "no_such_name"),
    (ConnectionRefusedError, "refused"),
    (TimeoutError, "too_slow"),
    (ssl.SSLError, "no_tls"),
    (http.client.HTTPException, "no_http"),
)


class Deliveries(JobKind[WebhookDelivery]):
    """One delivery at a time to each host, hosts that answered last first; tests ignore pauses, lost ones are due at
    once."""

    name, model, task, queue = "Delivery", WebhookDelivery, "league.tasks.deliver", "messages"
    waiting, working, finished = "due", "sending", "sent"
    since = "at"
    related = ("webhook",)
    needs = ()

    @property
    def lease(self) -> timedelta:
        return LEASE

    def due(self, now: datetime) -> QuerySet[WebhookDelivery]:
        busy = WebhookHost.objects.filter(host=OuterRef("webhook__host"), free_at__gt=now)
        return super().due(now).filter(Q(event=TEST) | ~Exists(busy))

    def next_in_queue(self, now: datetime) -> list[tuple[int, int]]:
        failures = WebhookHost.objects.filter(host=OuterRef("webhook__host")).values("failures")
        order = (Coalesce(Subquery(failures), 0), Coalesce("not_before", "at"), "pk")
        return list(self.due(now).order_by(*order).values_list("pk", "attempt")[:AT_A_TIME])

    def take(self, pk: int, attempt: int, *, worker: str, now: datetime) -> WebhookDelivery | None:
        """Nobody else sends it, and its host is the caller's until it is freed."""
        seen = WebhookDelivery.objects.filter(pk=pk).values_list("event", "webhook__host").first()
        if seen is None:
            return None
        event, host = seen
        WebhookHost.objects.get_or_create(host=host, defaults={"free_at": now})
        free = WebhookHost.objects.filter(host=host, free_at__lte=now)
        if not free.update(free_at=now + HOST_LEASE) and event != TEST:
            return None
        taken = super().take(pk, attempt, worker=worker, now=now)
        if taken is None:
            WebhookHost.objects.filter(host=host, free_at=now + HOST_LEASE).update(free_at=now)
        return taken


DELIVERIES = register(Deliveries())


def deliver_due(*, now: datetime, worker: str = "local") -> int:
    """Send what is due, at most twenty and for about a minute; returns how many were taken."""
    DELIVERIES.sweep(now=now, wake=False)
    give_up_late(now=now)
    until, taken = monotonic() + TURN_S, 0
    while taken < AT_A_TIME and monotonic() < until and (one := DELIVERIES.claim(worker=worker, now=now)) is not None:
        _deliver(one, now)
        taken += 1
    return taken


def hosts_due(*, now: datetime) -> int:
    """To how many hosts something may be sent now: so many deliveries can go at once."""
    return DELIVERIES.due(now).values("webhook__host").distinct().count()


def give_up_late(*, now: datetime) -> int:
    """Give up what has waited for half a day for a host that cannot be reached. Returns how many."""
    away = WebhookHost.objects.filter(host=OuterRef("webhook__host"), failures__gt=0)
    late = WebhookDelivery.objects.filter(Exists(away), state="due", at__lt=now - GIVEN_UP_AFTER)
    error = Case(When(error="", status=None, then=Value("host_away")), default=F("error"))
    return WebhookDelivery.objects.filter(pk__in=list(late.values_list("pk", flat=True))).update(
        state="failed", not_before=None, ended_at=now, error=error
    )


def signature(secret: str, body: bytes) -> str:
    """HMAC-SHA256 of a body as it stands in the header X-Paddock-Signature, for programs that were written for it."""
    return "sha256=" + hmac.new(secret.encode(), body, hashlib.sha256).hexdigest()


def _deliver(delivery: WebhookDelivery, now: datetime) -> None:
    body = delivery.body.encode()
    headers = _headers(delivery, body, now)
    status, error = None, ""
    try:
        status = outgoing.post(delivery.webhook.url, body, headers, allow_private=settings.WEBHOOKS_PRIVATE)
    except UserFault as fault:
        error = fault.code
    except (OSError, http.client.HTTPException) as fault:
        error = next((code for kind, code in _ERRORS if isinstance(fault, kind)), "no_connection")
    _free(delivery.webhook.host, now, reached=status is not None)
    mine, answer = DELIVERIES.held(delivery.pk, delivery.lease), {"status": status, "error": error}
    if status is not None and 200 <= status < 300:
        DELIVERIES.end(mine, state="sent", now=now, **answer)
    elif delivery.attempt >= TRIES or delivery.event == TEST:
        DELIVERIES.end(mine, state="failed", now=now, **answer)
    else:
        DELIVERIES.put_back(mine, now=now, pause=_pause(delivery.attempt), **answer)


def _free(name: str, now: datetime, *, reached: bool) -> None:
    """Let the next delivery to a host go: at once when it answered, otherwise after a pause."""
    row = WebhookHost.objects.filter(host=name)
    if reached:
        row.update(failures=0, free_at=now)
        return
    row.update(failures=F("failures") + 1)
    failures = row.values_list("failures", flat=True).first() or 1
    row.update(free_at=now + min(_pause(failures), LONGEST_PAUSE))


def _pause(tries: int) -> timedelta:
    """After how many tries in vain the next one comes when: 1, 4, 16, 64 minutes and so on."""
    return timedelta(minutes=4 ** (min(tries, 9) - 1))


def _headers(delivery: WebhookDelivery, body: bytes, now: datetime) -> dict[str, str]:
    hook = delivery.webhook
    headers = {"Content-Type": "application/json", "User-Agent": "Paddock"}
    if chat_of(hook.url):
        return headers  # a chat checks nothing
    secrets = secrets_of(hook, now)
    return {
        **headers,
        **signed_headers(secrets=secrets, message=f"msg_{delivery.pk}", now=now, body=body),
        "X-Paddock-Event": delivery.event,
        "X-Paddock-Delivery": str(delivery.pk),
        "X-Paddock-Signature": signature(hook.secret, body),
    }


PREFIX = "whsec_"


def shown(secret: str) -> str:
    """A secret in the form for libraries: a prefix, then Base64."""
    return PREFIX + secret


def signed_headers(*, secrets: Iterable[str], message: str, now: datetime, body: bytes) -> dict[str, str]:
    """The headers of a delivery, signed with each secret (Standard Webhooks 1.0). ``message``: the same for every
    try."""
    timestamp = str(int(now.timestamp()))
    signed = b".".join([message.encode(), timestamp.encode(), body])
    signatures = (hmac.new(b64decode(secret), signed, hashlib.sha256).digest() for secret in secrets)
    return {
        "webhook-id": message,
        "webhook-timestamp": timestamp,
        "webhook-signature": " ".join(f"v1,{b64encode(signature).decode()}" for signature in signatures),
    }
