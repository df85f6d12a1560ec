"""Quotas of single racers, invitations to sign up, known addresses, and grants of tokens."""

import secrets
from datetime import datetime

from django.conf import settings
from django.core.validators import MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from ..quotas import name_choices
from ..scopes import SCOPES

# An upper bound that every database stores, and no quota needs.
MOST = 2_000_000_000


class RacerQuota(models.Model):
    """One racer's own limit of one quota, in place of the site's."""

    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="quotas", verbose_name=_("racer"))
    name = models.CharField(_("quota"), max_length=40, choices=name_choices)
    limit = models.PositiveIntegerField(
        _("limit"), help_text=_("Replaces the site's limit. 0 means none."), validators=[MinValueValidator(0)]
    )

    class Meta:
        verbose_name = _("quota of a racer")
        verbose_name_plural = _("quotas of racers")
        constraints = [
            models.UniqueConstraint(fields=["racer", "name"], name="racer_quota_once"),
            models.CheckConstraint(condition=Q(limit__gte=0, limit__lte=MOST), name="racer_quota_in_bounds"),
        ]

    def __str__(self) -> str:
        return f"{self.racer}: {self.name} {self.limit}"


def new_code() -> str:
    """The secret part of an invitation's address: 128 bits."""
    return secrets.token_urlsafe(16)


class SignUpInvitation(models.Model):
    """A link with which so many people may sign up while sign-up is by invitation."""

    code = models.CharField(_("code"), max_length=32, unique=True, default=new_code, editable=False)
    note = OneLineField(_("note"), max_length=100, blank=True, help_text=_("For admins: the intended recipient."))
    uses = models.PositiveIntegerField(_("racers"), default=1, help_text=_("Number of racers who can sign up with it."))
    used = models.PositiveIntegerField(_("signed up"), default=0, editable=False)
    expires_at = models.DateTimeField(_("expires"))
    made_by = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        editable=False,
        related_name="+",
        verbose_name=_("created by"),
    )
    made_at = models.DateTimeField(_("created"), editable=False)

    class Meta:
        verbose_name = _("invitation to sign up")
        verbose_name_plural = _("invitations to sign up")
        ordering = ["-made_at", "-pk"]
        constraints = [
            models.CheckConstraint(condition=Q(uses__gte=1, uses__lte=10_000), name="invitation_uses_in_bounds"),
            models.CheckConstraint(condition=Q(used__lte=F("uses")), name="invitation_used_within_its_uses"),
        ]

    def __str__(self) -> str:
        return self.note or self.code[:6]

    def get_absolute_url(self) -> str:
        return reverse("sign_up_invitation", args=[self.code])

    def is_open(self, now: datetime) -> bool:
        return self.used < self.uses and now < self.expires_at


class KnownAddress(models.Model):
    """A racer has logged in from an address, which is kept as a digest (:mod:`accounts.signing_in.attempt_limits`)."""

    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="known_addresses")
    digest = models.CharField(max_length=64)
    seen_at = models.DateTimeField()

    class Meta:
        verbose_name = _("known address")
        verbose_name_plural = _("known addresses")
        constraints = [models.UniqueConstraint(fields=["racer", "digest"], name="known_address_once")]

    def __str__(self) -> str:
        return f"{self.racer_id}: {self.digest[:8]}"


class TokenGrant(models.Model):
    """What an API token may do, and when it was last used. One from before there were scopes has no row until then."""

    token = models.OneToOneField(
        settings.KNOX_TOKEN_MODEL, models.CASCADE, primary_key=True, related_name="grant", verbose_name=_("token")
    )
    may_read = models.BooleanField(_("can read"))
    may_race = models.BooleanField(_("can race"))
    may_train = models.BooleanField(_("can train"))
    may_organise = models.BooleanField(_("can organise"))
    last_used_at = models.DateTimeField(_("last used"), null=True, editable=False)

    class Meta:
        verbose_name = _("grant of a token")
        verbose_name_plural = _("grants of tokens")
        constraints = [
            models.CheckConstraint(
                condition=Q(may_read=True) | Q(may_race=True) | Q(may_train=True) | Q(may_organise=True),
                name="token_grant_of_something",
            )
        ]

    def __str__(self) -> str:
        return ", ".join(self.scopes)

    @property
    def scopes(self) -> list[str]:
        return [scope for scope in SCOPES if getattr(self, f"may_{scope}")]
