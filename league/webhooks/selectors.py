"""The webhooks of a racer and their deliveries, visible to the racer only."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import Q, QuerySet

from accounts.models import Racer
from races.models import Race

from ..models import Webhook, WebhookDelivery

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def webhooks_of(racer: Racer | AnonymousUser) -> QuerySet[Webhook]:
    """A racer's webhooks, the oldest first; none for guests."""
    return Webhook.objects.filter(owner_id=racer.pk).select_related("race")


def deliveries_of(racer: Racer | AnonymousUser) -> QuerySet[WebhookDelivery]:
    """The deliveries of a racer's webhooks, the latest first."""
    return WebhookDelivery.objects.filter(webhook__owner_id=racer.pk).select_related("webhook")


def races_for_webhooks(racer: Racer) -> QuerySet[Race]:
    """The races that a racer can add a webhook for: those they organise and those they are in."""
    mine = Q(organiser=racer) | Q(pk__in=racer.entries.filter(withdrawn_at=None).values("race"))
    return Race.objects.filter(mine).order_by("-opens_at", "pk")
