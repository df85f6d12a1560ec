"""Invitations to a race by e-mail, each with a link for one use."""

from datetime import datetime

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer
from core.jobs.models import Leased, lease_constraints


class MailInvitation(Leased):
    """An address invited to a race. ``state``: of its mail (``due``, ``sending``, ``sent``, ``failed``).

    The link carries the row and ``turn`` under the site's signature; another mail invalidates it. Organisers do not see
    what became of a mail: it would reveal whether an address has an account or wants no invitations.
    """

    race = models.ForeignKey("races.Race", models.CASCADE, related_name="mail_invitations", verbose_name=_("race"))
    email = models.EmailField(_("e-mail address"))
    made_by = models.ForeignKey(Racer, models.SET_NULL, null=True, related_name="+", verbose_name=_("created by"))
    asked_at = models.DateTimeField(_("asked"))
    turn = models.PositiveSmallIntegerField(_("mails"), default=1)
    expires_at = models.DateTimeField(_("expires"))
    language = models.CharField(_("language of e-mails"), max_length=5, choices=settings.LANGUAGES, default="en")
    withdrawn_at = models.DateTimeField(_("withdrawn"), null=True, blank=True)
    accepted_at = models.DateTimeField(_("accepted"), null=True, blank=True)
    accepted_by = models.ForeignKey(Racer, models.SET_NULL, null=True, blank=True, related_name="+")
    state = models.CharField(_("state"), max_length=8, default="due")

    class Meta:
        verbose_name = _("invitation by e-mail")
        verbose_name_plural = _("invitations by e-mail")
        ordering = ["pk"]
        indexes = [
            models.Index(fields=["id"], name="mail_invitation_due", condition=Q(state="due")),
            models.Index(fields=["made_by", "asked_at"], name="mail_invitation_asked"),
            models.Index(fields=["email", "asked_at"], name="mail_invitation_email"),
        ]
        constraints = [
            models.UniqueConstraint(fields=["race", "email"], name="mail_invitation_once"),
            models.CheckConstraint(
                condition=Q(accepted_at=None) | Q(withdrawn_at=None), name="mail_invitation_accepted_or_withdrawn"
            ),
            *lease_constraints("mail_invitation", waiting="due", working="sending", final=["sent", "failed"]),
        ]

    def __str__(self) -> str:
        return f"{self.race}: {self.email}"

    def standing_at(self, now: datetime) -> str:
        """Its state for the organiser: accepted, withdrawn, expired or invited."""
        if self.accepted_at is not None:
            return "accepted"
        if self.withdrawn_at is not None:
            return "withdrawn"
        return "invited" if now < self.expires_at else "expired"


class NoInvitations(models.Model):
    """An address whose owner wants no invitations, from nobody."""

    email = models.EmailField(_("e-mail address"), unique=True)
    at = models.DateTimeField(_("at"))

    class Meta:
        verbose_name = _("address without invitations")
        verbose_name_plural = _("addresses without invitations")

    def __str__(self) -> str:
        return self.email
