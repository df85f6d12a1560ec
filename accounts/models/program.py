"""Accounts of programs."""

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

PREFIX = "program-"


class ServiceAccount(models.Model):
    """A program's account: a racer without password and e-mail log-in, with tokens and a responsible owner.

    The racer has ``is_program``, an alias that begins with :data:`PREFIX`, and is inactive while it is disabled."""

    racer = models.OneToOneField(
        settings.AUTH_USER_MODEL, models.CASCADE, primary_key=True, related_name="program", verbose_name=_("account")
    )
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="programs",
        verbose_name=_("owner"),
    )
    purpose = OneLineField(_("purpose"), max_length=200)
    made_at = models.DateTimeField(_("created"))

    class Meta:
        verbose_name = _("program")
        verbose_name_plural = _("programs")
        ordering = ["racer__alias"]

    def __str__(self) -> str:
        return self.racer.alias
