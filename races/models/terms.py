"""The terms of a race: every version as written, and their acceptances with racer, version and time."""

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from .entry import Entry
from .race import MOST_TERMS, Race


class RaceTerms(models.Model):
    """One version of a race's terms. It never changes: other words are the next version."""

    race = models.ForeignKey(Race, models.CASCADE, related_name="terms_written", db_index=False)
    version = models.PositiveSmallIntegerField()
    text = models.TextField(max_length=MOST_TERMS)
    written_at = models.DateTimeField(default=timezone.now)

    class Meta:
        verbose_name = _("version of a race's terms")
        verbose_name_plural = _("versions of races' terms")
        ordering = ["race", "version"]
        constraints = [
            models.UniqueConstraint(fields=["race", "version"], name="race_terms_version_once"),
            models.CheckConstraint(condition=Q(version__gte=1), name="race_terms_count_from_one"),
            models.CheckConstraint(condition=~Q(text=""), name="race_terms_say_something"),
        ]

    def __str__(self) -> str:
        return f"{self.race} {self.version}"


class TermsAcceptance(models.Model):
    """A racer's acceptance of a version of the terms of their race."""

    # no separate index: the unique one begins with it
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="accepted_terms", db_index=False)
    terms = models.ForeignKey(RaceTerms, models.RESTRICT, related_name="acceptances")
    accepted_at = models.DateTimeField(default=timezone.now)

    class Meta:
        verbose_name = _("acceptance of terms")
        verbose_name_plural = _("acceptances of terms")
        ordering = ["entry", "terms"]
        constraints = [models.UniqueConstraint(fields=["entry", "terms"], name="race_terms_accepted_once")]

    def __str__(self) -> str:
        return f"{self.entry} {self.terms_id}"
