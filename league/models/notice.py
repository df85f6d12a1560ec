"""What racers are told, in the site and by e-mail, and what programs of organisers are told."""

from __future__ import annotations

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer
from core.jobs.models import Leased, lease_constraints


class NoticeKind(models.TextChoices):
    """What a notice tells. Each can be turned off, in the site and by e-mail."""

    OPENS = "opens", _("a race opens")
    CLOSES = "closes", _("a race closes in a day")
    RESULT = "result", _("a result is in")
    LOST_LEAD = "lost_lead", _("the lead is lost")
    PROMOTED = "promoted", _("promoted")
    FINALE = "finale", _("in the finale")
    QUALIFIED = "qualified", _("qualified for the championship")
    OFFICIAL = "official", _("results are official")
    MESSAGE = "message", _("an announcement from the organisers")
    CANCELLED = "cancelled", _("a race is cancelled")
    DISQUALIFIED = "disqualified", _("disqualified by the stewards")
    RESTORED = "restored", _("reinstated by the stewards")
    RETIMED = "retimed", _("your time changed with a new engine")
    CUP = "cup", _("a cup of the day is over")
    FOLLOWED = "followed", _("a racer you follow leads or wins")
    TEAM = "team", _("a team asks you to join")
    SEASON = "season", _("the next season is drafted (for admins)")


# A result comes seconds after sending a car, and others race all day: whoever wants that by mail turns it on.
NOT_MAILED = (NoticeKind.RESULT, NoticeKind.CUP, NoticeKind.FOLLOWED)


class Notice(models.Model):
    """One thing that a racer is told, once: ``about`` says what makes it the same thing.

    One that goes by mail has a :class:`Mail`. Its sentence is made of ``kind`` and ``params``
    when it is read, in the reader's language (league.notices).
    """

    racer = models.ForeignKey(Racer, models.CASCADE, related_name="notices", verbose_name=_("racer"), db_index=False)
    kind = models.CharField(_("kind"), max_length=12, choices=NoticeKind.choices)
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
            models.CheckConstraint(condition=Q(kind__in=NoticeKind.values), name="notice_kind_known"),
        ]

    def __str__(self) -> str:
        return f"{self.racer}: {self.get_kind_display()}"


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
    """What a racer wants to be told and how; who has no row is told everything in the usual way."""

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
    """Who was last seen leading a race, to tell them when they no longer do."""

    race = models.OneToOneField("races.Race", models.CASCADE, primary_key=True, related_name="lead_seen")
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="+")

    class Meta:
        verbose_name = _("lead")
        verbose_name_plural = _("leads")

    def __str__(self) -> str:
        return f"{self.race}: {self.racer}"
