"""Notices to racers, on the site and by e-mail."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer
from core.jobs.models import Leased, lease_constraints


class Notice(models.Model):
    """A notice, written once for each racer, ``kind`` and ``about``; its sentence is made of ``params`` when it is
    read."""

    racer = models.ForeignKey(Racer, models.CASCADE, related_name="notices", verbose_name=_("racer"), db_index=False)
    kind = models.CharField(_("kind"), max_length=12)  # a name of league.notices.kinds
    about = models.CharField(_("about"), max_length=160)
    params = models.JSONField(_("text"), default=dict, blank=True)
    path = models.CharField(_("link"), max_length=200, blank=True)
    at = models.DateTimeField(_("at"))
    hidden = models.BooleanField(_("by mail only"), default=False)
    read_at = models.DateTimeField(_("read"), null=True, blank=True)

    class Meta:
        verbose_name = _("notice")
        verbose_name_plural = _("notices")
        ordering = ["-at", "-pk"]
        indexes = [
            models.Index(fields=["racer", "-at"], name="notice_by_racer"),
            models.Index(fields=["at"], name="notice_by_time"),
        ]
        constraints = [
            models.UniqueConstraint(fields=["racer", "kind", "about"], name="notice_once"),
        ]

    def __str__(self) -> str:
        return f"{self.racer}: {self.kind}"


class Mail(Leased):
    """A notice that goes by mail, once at the most. ``state``: ``due``, ``sending``, ``sent``, ``failed``."""

    notice = models.OneToOneField(Notice, models.CASCADE, related_name="mail", verbose_name=_("notice"))
    state = models.CharField(_("state"), max_length=8, default="due")

    class Meta:
        verbose_name = _("mail")
        verbose_name_plural = _("mails")
        indexes = [
            models.Index(fields=["id"], name="mail_due", condition=Q(state="due")),
            models.Index(fields=["leased_until"], name="mail_leases", condition=Q(state="sending")),
        ]
        constraints = lease_constraints("mail", waiting="due", working="sending", final=["sent", "failed"])

    def __str__(self) -> str:
        return str(self.notice)


class NoticeChoice(models.Model):
    """A racer's notice settings; racers without a row have the default ones."""

    racer = models.OneToOneField(Racer, models.CASCADE, primary_key=True, related_name="notice_choice")
    site_off = models.JSONField(_("off on the site"), default=list, blank=True)
    mail_off = models.JSONField(_("off by e-mail"), default=list, blank=True)
    language = models.CharField(_("language of e-mails"), max_length=5, choices=settings.LANGUAGES, default="en")

    class Meta:
        verbose_name = _("choice of notices")
        verbose_name_plural = _("choices of notices")

    def __str__(self) -> str:
        return str(self.racer)


class Lead(models.Model):
    """The last known leader of a race, for the notice of a lost lead."""

    race = models.OneToOneField("races.Race", models.CASCADE, primary_key=True, related_name="lead_seen")
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="+")

    class Meta:
        verbose_name = _("lead")
        verbose_name_plural = _("leads")

    def __str__(self) -> str:
        return f"{self.race}: {self.racer}"
