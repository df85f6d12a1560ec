"""How well racers drive against each other."""

from __future__ import annotations

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer

from .season import Season


class DuelRating(models.Model):
    """What a season's duels say of a racer: openskill's ``mu`` and ``sigma`` (races.duels.ratings).

    Worked out anew from all decided duels of the season whenever a race of it has driven its last one.
    """

    # no index of its own: the unique one over season and racer begins with it
    season = models.ForeignKey(
        Season, models.CASCADE, related_name="duel_ratings", verbose_name=_("season"), db_index=False
    )
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="duel_ratings", verbose_name=_("racer"))
    mu = models.FloatField(_("skill"))
    sigma = models.FloatField(_("uncertainty"))
    duels = models.PositiveIntegerField(_("duels"))

    class Meta:
        verbose_name = _("rating")
        verbose_name_plural = _("ratings")
        ordering = ["season", "pk"]
        constraints = [
            models.UniqueConstraint(fields=["season", "racer"], name="rating_once_a_season"),
            models.CheckConstraint(condition=Q(sigma__gt=0, duels__gte=1), name="rating_after_a_duel"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.season} · {self.shown:.1f}"

    @property
    def shown(self) -> float:
        """The skill that the racer has with near certainty: mu - 3 sigma."""
        return self.mu - 3 * self.sigma
