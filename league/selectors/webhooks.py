"""What pages and programs show of webhooks. A webhook with its secret is its owner's alone, admins' neither."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import Q, QuerySet

from accounts.models import Racer
from races.models import Race

from ..models import Webhook, WebhookDelivery

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def webhooks_of(racer: Racer | AnonymousUser) -> QuerySet[Webhook]:
    """The racer's webhooks, the oldest first; none for somebody who is not logged in."""
    return Webhook.objects.filter(owner_id=racer.pk).select_related("race")


def deliveries_of(racer: Racer | AnonymousUser) -> QuerySet[WebhookDelivery]:
    """What the racer's webhooks were told, the latest first."""
    return WebhookDelivery.objects.filter(webhook__owner_id=racer.pk).select_related("webhook")


def races_to_hear_of(racer: Racer) -> QuerySet[Race]:
    """The races that a webhook of the racer may be for: those they organise and those they are in."""
    mine = Q(organiser=racer) | Q(pk__in=racer.entries.filter(withdrawn_at=None).values("race"))
    return Race.objects.filter(mine).order_by("-opens_at", "pk")
