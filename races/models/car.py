"""Which car is whose in a race that lets each car race for one racer only."""

from __future__ import annotations

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from evaluation.models import SHA256

from .entry import Entry
from .race import Race


def car_of(sha256: str, facts: dict | None) -> str:
    """What makes a network the same car in a race: its answers, or where they are not known its own sha-256."""
    return (facts or {}).get("answers") or sha256


class RaceCar(models.Model):
    """The entry that sent a car to a race first, and so keeps its place. Once for each race and car.

    ``car``: of its network, see :func:`car_of`.
    """

    race = models.ForeignKey(Race, models.CASCADE, related_name="cars", verbose_name=_("race"), db_index=False)
    car = models.CharField(_("car"), max_length=64)
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="cars", verbose_name=_("entry"))

    class Meta:
        verbose_name = _("car of a race")
        verbose_name_plural = _("cars of a race")
        constraints = [
            models.UniqueConstraint(fields=["race", "car"], name="racecar_once_in_a_race"),
            models.CheckConstraint(condition=Q(car__regex=SHA256), name="racecar_car_form"),
        ]

    def __str__(self) -> str:
        return f"{self.car[:12]} of {self.entry}"


class RefusedCar(models.Model):
    """Somebody else tried to send a car that was in the race already; organisers see it."""

    car = models.ForeignKey(RaceCar, models.CASCADE, related_name="refused", verbose_name=_("car"), db_index=False)
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="refused_cars", verbose_name=_("racer")
    )
    at = models.DateTimeField(_("last tried"))
    same_file = models.BooleanField(
        _("byte-identical"), help_text=_("The same network as in the race, not just one with the same outputs.")
    )

    class Meta:
        verbose_name = _("refused car")
        verbose_name_plural = _("refused cars")
        constraints = [models.UniqueConstraint(fields=["car", "racer"], name="refusedcar_once_for_a_racer")]

    def __str__(self) -> str:
        return f"{self.car} for {self.racer}"
