"""Webhooks, their hosts and their deliveries."""

from datetime import datetime

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.jobs.models import Leased, lease_constraints


def new_secret() -> str:
    """What the deliveries of a webhook are signed with (40 letters and digits, which are Base64 of 30 bytes)."""
    return get_random_string(40)


class Webhook(models.Model):
    """A racer's address for messages about their cars and the races that they organise, or about one ``race`` only.

    ``events``: names in :data:`league.webhooks.payloads.EVENTS`; empty for all. ``old_secret``: signs too for a day.
    """

    owner = models.ForeignKey(Racer, models.CASCADE, related_name="webhooks", verbose_name=_("owner"))
    race = models.ForeignKey(
        "races.Race", models.CASCADE, null=True, blank=True, related_name="webhooks", verbose_name=_("race")
    )
    url = models.URLField(_("address"), max_length=500)
    host = models.CharField(_("host"), max_length=255, db_default="", default="", blank=True, editable=False)
    events = models.JSONField(_("events"), default=list, blank=True)
    secret = models.CharField(_("secret"), max_length=40, default=new_secret, editable=False)
    old_secret = models.CharField(_("previous secret"), max_length=40, blank=True, editable=False)
    old_secret_until = models.DateTimeField(_("valid until"), null=True, blank=True, editable=False)
    created_at = models.DateTimeField(_("created"), default=timezone.now, editable=False)

    class Meta:
        verbose_name = _("webhook")
        verbose_name_plural = _("webhooks")
        ordering = ["pk"]
        constraints = [
            models.CheckConstraint(
                condition=Q(old_secret="", old_secret_until=None) | ~Q(old_secret="") & ~Q(old_secret_until=None),
                name="webhook_old_secret_ends",
            )
        ]

    def __str__(self) -> str:
        return self.url


class WebhookHost(models.Model):
    """A host of webhooks. It receives one delivery at a time, none before ``free_at``, a pause that grows with
    ``failures``."""

    host = models.CharField(_("host"), max_length=255, primary_key=True)
    failures = models.PositiveSmallIntegerField(_("failures in a row"), default=0)
    free_at = models.DateTimeField(_("next delivery at"))

    class Meta:
        verbose_name = _("host of webhooks")
        verbose_name_plural = _("hosts of webhooks")

    def __str__(self) -> str:
        return self.host


class WebhookDelivery(Leased):
    """A message to a webhook, sent once. ``state``: due, sending, sent, failed; ``error``: why there was no
    ``status``."""

    webhook = models.ForeignKey(Webhook, models.CASCADE, related_name="deliveries", db_index=False)
    event = models.CharField(_("event"), max_length=20)
    about = models.CharField(_("about"), max_length=160)
    body = models.TextField(_("body"))
    at = models.DateTimeField(_("at"))
    state = models.CharField(_("state"), max_length=8, default="due")
    status = models.PositiveSmallIntegerField(_("answer"), null=True, blank=True)
    error = models.CharField(_("error"), max_length=200, blank=True)

    class Meta:
        verbose_name = _("delivery")
        verbose_name_plural = _("deliveries")
        ordering = ["-at", "-pk"]
        indexes = [
            models.Index(fields=["not_before"], name="delivery_due", condition=Q(state="due")),
            models.Index(fields=["at"], name="delivery_by_time"),
            models.Index(fields=["leased_until"], name="delivery_leases", condition=Q(state="sending")),
        ]
        constraints = [
            models.UniqueConstraint(fields=["webhook", "event", "about"], name="delivery_once"),
            *lease_constraints("delivery", waiting="due", working="sending", final=["sent", "failed"]),
        ]

    def __str__(self) -> str:
        return f"{self.webhook}: {self.event}"

    @property
    def is_due(self) -> bool:
        """Whether it waits or is on its way."""
        return self.state in ("due", "sending")

    @property
    def next_at(self) -> datetime:
        """When it is tried next, of one that is due."""
        return self.not_before or self.leased_until or self.ended_at or self.at
