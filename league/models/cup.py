"""Cups of the day: the qualifying, its knock-outs, and the winners."""

from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer
from evaluation.models import TrainedModel
from races.models import Race


class Cup(models.Model):
    """One day's cup. ``race``: its qualifying; ``over_at``: when the last heat was decided, or could not take place."""

    day = models.DateField(_("day"), unique=True)
    race = models.OneToOneField(Race, models.CASCADE, related_name="cup", verbose_name=_("qualifying"))
    drawn_at = models.DateTimeField(_("drawn"), null=True, blank=True, editable=False)
    over_at = models.DateTimeField(_("over"), null=True, blank=True, editable=False)

    class Meta:
        verbose_name = _("cup of the day")
        verbose_name_plural = _("cups of the day")
        ordering = ["-day"]
        indexes = [models.Index(fields=["day"], condition=Q(over_at=None), name="cup_under_way")]
        constraints = [
            models.CheckConstraint(
                condition=Q(drawn_at=None) | Q(over_at=None) | Q(over_at__gte=F("drawn_at")),
                name="cup_over_after_the_draw",
            )
        ]

    def __str__(self) -> str:
        return f"{self.day:%Y-%m-%d}"

    def get_absolute_url(self) -> str:
        return reverse("cup", args=[self.day.isoformat()])


class CupDivision(models.Model):
    """The knock-out of one division, 1 being that of the fastest in the qualifying."""

    cup = models.ForeignKey(Cup, models.CASCADE, related_name="divisions", verbose_name=_("cup"), db_index=False)
    number = models.PositiveSmallIntegerField(_("number"))
    race = models.OneToOneField(Race, models.CASCADE, related_name="cup_division", verbose_name=_("knock-out"))

    class Meta:
        verbose_name = _("division of a cup")
        verbose_name_plural = _("divisions of cups")
        ordering = ["cup", "number"]
        constraints = [
            models.UniqueConstraint(fields=["cup", "number"], name="cup_division_once"),
            models.CheckConstraint(condition=Q(number__gte=1), name="cup_division_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.cup} · {self.number}"


class CupPlace(models.Model):
    """Where a racer ended: ``place`` in the knock-out of a division, ``qualified`` in the qualifying, both from 1."""

    cup = models.ForeignKey(Cup, models.CASCADE, related_name="places", verbose_name=_("cup"), db_index=False)
    division = models.PositiveSmallIntegerField(_("division"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="cup_places", verbose_name=_("racer"))
    place = models.PositiveSmallIntegerField(_("place"))
    qualified = models.PositiveSmallIntegerField(_("place in the qualifying"))

    class Meta:
        verbose_name = _("place in a cup")
        verbose_name_plural = _("places in cups")
        ordering = ["cup", "division", "place"]
        constraints = [
            models.UniqueConstraint(fields=["cup", "racer"], name="cup_place_once_a_racer"),
            models.UniqueConstraint(fields=["cup", "division", "place"], name="cup_place_once"),
            models.CheckConstraint(
                condition=Q(division__gte=1, place__gte=1, qualified__gte=1), name="cup_place_range"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.cup} · {self.division}/{self.place}"


class CupStarter(models.Model):
    """A car that starts in every cup automatically until its racer turns that off."""

    racer = models.OneToOneField(Racer, models.CASCADE, primary_key=True, related_name="cup_starter")
    model = models.ForeignKey(TrainedModel, models.CASCADE, related_name="+", verbose_name=_("model"))
    since = models.DateTimeField(_("since"))

    class Meta:
        verbose_name = _("standing entry in cups")
        verbose_name_plural = _("standing entries in cups")

    def __str__(self) -> str:
        return str(self.racer)
