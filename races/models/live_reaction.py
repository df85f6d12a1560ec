"""How often spectators of a live event sent each reaction."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from .live import LiveEvent


class ReactionKind(models.TextChoices):
    CLAP = "clap", _("applause")
    FIRE = "fire", _("fast")
    WOW = "wow", _("astonished")
    LAUGH = "laugh", _("funny")
    HEART = "heart", _("love it")
    FLAG = "flag", _("finish")


class LiveReaction(models.Model):
    """The count of a reaction; its senders are not stored."""

    # no separate index: the unique one over event and kind begins with it
    event = models.ForeignKey(
        LiveEvent, models.CASCADE, related_name="reactions", verbose_name=_("live event"), db_index=False
    )
    kind = models.CharField(_("reaction"), max_length=8, choices=ReactionKind.choices)
    count = models.PositiveBigIntegerField(_("count"), default=0)

    class Meta:
        verbose_name = _("reaction to a live event")
        verbose_name_plural = _("reactions to live events")
        constraints = [
            models.UniqueConstraint(fields=["event", "kind"], name="live_reaction_once_a_kind"),
            models.CheckConstraint(condition=Q(kind__in=ReactionKind.values), name="live_reaction_kind_known"),
        ]

    def __str__(self) -> str:
        return f"{self.event} {self.kind}: {self.count}"
