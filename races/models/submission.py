"""What racers sent to a race."""

from __future__ import annotations

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from .entry import Entry


class Submission(models.Model):
    """One car sent to one race by an entry, and the evaluation that measures it."""

    # no index of its own: the unique one over entry and number begins with it
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
            # (a live event has several attempts, and says itself how many)
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
