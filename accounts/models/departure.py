"""Past aliases, aliases that wait for their former owner, and deleted accounts."""

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _


class PastAlias(models.Model):
    """An alias that a racer had until ``changed_at``. The racer, stewards and admins see it."""

    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="past_aliases", verbose_name=_("racer")
    )
    alias = models.CharField(_("alias"), max_length=64)
    changed_at = models.DateTimeField(_("changed"))

    class Meta:
        verbose_name = _("past alias")
        verbose_name_plural = _("past aliases")
        ordering = ["-changed_at", "-pk"]
        indexes = [models.Index(models.functions.Lower("alias"), name="past_alias_lower")]

    def __str__(self) -> str:
        return self.alias


class ReservedAlias(models.Model):
    """Until then nobody else may take an alias or one that looks like it. ``racer``: None for a deleted account, of
    whose alias only a digest is kept (:mod:`accounts.signing_in.reserved_aliases`)."""

    digest = models.CharField(_("digest"), max_length=64, primary_key=True)
    until = models.DateTimeField(_("until"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, null=True, related_name="+", verbose_name=_("racer")
    )

    class Meta:
        verbose_name = _("reserved alias")
        verbose_name_plural = _("reserved aliases")

    def __str__(self) -> str:
        return self.digest[:8]


class DeletedAccount(models.Model):
    """A deleted account. Its racer row stays without a name, for results."""

    racer = models.OneToOneField(
        settings.AUTH_USER_MODEL, models.CASCADE, primary_key=True, related_name="deletion", verbose_name=_("racer")
    )
    deleted_at = models.DateTimeField(_("deleted"))
    by_racer = models.BooleanField(_("by the racer"))

    class Meta:
        verbose_name = _("deleted account")
        verbose_name_plural = _("deleted accounts")
        ordering = ["-deleted_at"]

    def __str__(self) -> str:
        return str(self.racer_id)
