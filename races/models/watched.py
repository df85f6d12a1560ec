"""What a racer who hides results has watched."""

from __future__ import annotations

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from .race import Race


class WatchedRace(models.Model):
    """That a racer has watched a race, or had its results shown: they are hidden no more.

    ``live``: whether its live event had begun by then. What was shown before an event begins is the qualifying; the
    event itself is hidden again.
    """

    # no index of its own: the unique one over racer and race begins with it
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="watched_races", verbose_name=_("racer"), db_index=False
    )
    race = models.ForeignKey(Race, models.CASCADE, related_name="watched_by", verbose_name=_("race"))
    at = models.DateTimeField(_("watched"))
    live = models.BooleanField(_("with its live event"), default=False)

    class Meta:
        verbose_name = _("watched race")
        verbose_name_plural = _("watched races")
        constraints = [models.UniqueConstraint(fields=["racer", "race"], name="watched_race_once")]

    def __str__(self) -> str:
        return f"{self.racer}: {self.race}"
