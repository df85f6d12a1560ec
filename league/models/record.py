"""What an imported record contains besides races and entries, kept for its export in the old service's form."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from races.models import Entry

from .season import Season


class RecordedSeason(models.Model):
    """A season that was imported. ``digest``: sha-256 over all that was read, by which a second import knows it."""

    season = models.OneToOneField(Season, models.CASCADE, related_name="record", verbose_name=_("season"))
    label = models.CharField(_("season in the record"), max_length=50, unique=True)
    digest = models.CharField(_("digest"), max_length=64)
    imported_at = models.DateTimeField(_("imported"))

    class Meta:
        verbose_name = _("imported season")
        verbose_name_plural = _("imported seasons")

    def __str__(self) -> str:
        return self.label


class RecordedRace(models.Model):
    """A race as recorded, column by column, and the heading of its file of results."""

    race = models.OneToOneField("races.Race", models.CASCADE, related_name="record", verbose_name=_("race"))
    position = models.PositiveIntegerField(_("row in races.csv"))
    row = models.JSONField(_("row"))
    heading = models.JSONField(_("columns of the results"))
    decimals = models.JSONField(_("columns written with a decimal point"), default=list, blank=True)

    class Meta:
        verbose_name = _("imported race")
        verbose_name_plural = _("imported races")

    def __str__(self) -> str:
        return self.row.get("file", "")


class RecordedResult(models.Model):
    """A result as recorded, without the values of its entry. ``measured``: whether ``score`` is the time ranked by."""

    entry = models.OneToOneField(
        Entry, models.CASCADE, primary_key=True, related_name="record", verbose_name=_("entry")
    )
    alias = OneLineField(_("alias"), max_length=64)
    rank = models.PositiveIntegerField(_("rank"))
    score = models.BigIntegerField(_("score"))
    measured = models.BooleanField(_("the score is the ranking time"), default=True)
    collisions = models.PositiveIntegerField(_("collisions"), default=0)
    average_resets = models.FloatField(_("resets a lap"), default=0.0)
    status = OneLineField(_("status"), max_length=32)
    division = OneLineField(_("division"), max_length=32, blank=True)
    blank = models.JSONField(_("columns left empty"), default=list, blank=True)

    class Meta:
        verbose_name = _("imported result")
        verbose_name_plural = _("imported results")
        constraints = [
            models.CheckConstraint(condition=Q(rank__gte=1), name="recorded_rank_from_one"),
            models.CheckConstraint(condition=Q(score__gte=0), name="recorded_score_not_negative"),
        ]

    def __str__(self) -> str:
        return f"{self.alias} · {self.rank}"
