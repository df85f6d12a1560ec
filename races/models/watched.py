"""The races watched by a racer with hidden results."""

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from .race import Race


class WatchedRace(models.Model):
    """A race whose results are no longer hidden from a racer. ``live``: whether its live event had begun by then."""

    # no separate index: the unique one over racer and race begins with it
    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="watched_races", db_index=False)
    race = models.ForeignKey(Race, models.CASCADE, related_name="watched_by")
    at = models.DateTimeField()
    live = models.BooleanField(default=False)

    class Meta:
        verbose_name = _("watched race")
        verbose_name_plural = _("watched races")
        constraints = [models.UniqueConstraint(fields=["racer", "race"], name="watched_race_once")]

    def __str__(self) -> str:
        return f"{self.racer}: {self.race}"
