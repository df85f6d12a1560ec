"""The submissions to a race, and whose cars these are where a car races for one racer only."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from evaluation.models import SHA256

from .entry import Entry
from .race import Race


class Submission(models.Model):
    """One car sent to one race by an entry, and the evaluation that measures it."""

    # no separate index: the unique one over entry and number begins with it
    entry = models.ForeignKey(
        Entry, models.CASCADE, related_name="submissions", verbose_name=_("entry"), db_index=False
    )
    number = models.PositiveSmallIntegerField(_("number"))
    evaluation = models.OneToOneField(
        "evaluation.Evaluation", models.PROTECT, related_name="submission", verbose_name=_("evaluation")
    )
    network = models.ForeignKey("evaluation.Network", models.PROTECT, related_name="+", verbose_name=_("network"))
    submitted_at = models.DateTimeField(_("submitted"), default=timezone.now)
    is_void = models.BooleanField(
        _("void"), default=False, help_text=_("Ended without a result. The car can be submitted again.")
    )
    refunded = models.BooleanField(
        _("refunded"), default=False, help_text=_("Does not count against the submission limit.")
    )
    is_live = models.BooleanField(
        _("driven live"),
        default=False,
        db_default=False,
        editable=False,
        help_text=_("A run of the race's live event: it counts before all others, and among no submissions."),
    )
    car_of = models.ForeignKey(
        Entry,
        models.SET_NULL,
        null=True,
        blank=True,
        editable=False,
        related_name="+",
        verbose_name=_("first entry with this car"),
        help_text=_("First entry with this car. It does not count for others."),
    )

    class Meta:
        verbose_name = _("submission")
        verbose_name_plural = _("submissions")
        ordering = ["-submitted_at", "-pk"]
        constraints = [
            models.UniqueConstraint(fields=["entry", "number"], name="submission_number_once"),
            # one car, one result: the same network cannot be sent twice to a race by the same racer
            # (a live event has several attempts, with its own limit)
            models.UniqueConstraint(
                fields=["entry", "network"], condition=Q(is_void=False, is_live=False), name="submission_of_a_car_once"
            ),
            models.CheckConstraint(condition=Q(refunded=False) | Q(is_void=True), name="submission_refunded_is_void"),
            models.CheckConstraint(
                condition=Q(car_of=None) | ~Q(car_of=models.F("entry")), name="submission_is_no_copy_of_its_own"
            ),
            models.CheckConstraint(condition=Q(number__gte=1), name="submission_number_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.entry} #{self.number}"


def car_of(sha256: str, facts: dict | None) -> str:
    """The identity of a car in a race: its network's output, or if unknown the network's sha-256."""
    return (facts or {}).get("answers") or sha256


class RaceCar(models.Model):
    """The entry that holds a car (:func:`car_of`) in a race, where no other may send it."""

    race = models.ForeignKey(Race, models.CASCADE, related_name="cars", db_index=False)
    car = models.CharField(max_length=64)
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="cars")

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
    """Another racer's attempt to send a car that was in the race already, for organisers. ``same_file``: with the same
    network, not just one with the same outputs."""

    car = models.ForeignKey(RaceCar, models.CASCADE, related_name="refused", db_index=False)
    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="refused_cars")
    at = models.DateTimeField()
    same_file = models.BooleanField()

    class Meta:
        verbose_name = _("refused car")
        verbose_name_plural = _("refused cars")
        constraints = [models.UniqueConstraint(fields=["car", "racer"], name="refusedcar_once_for_a_racer")]

    def __str__(self) -> str:
        return f"{self.car} for {self.racer}"
