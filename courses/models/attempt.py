"""Attempts of students, and their runs."""

from collections.abc import Mapping
from typing import Any

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from core.ids import new_public_id

from .assignment import Assignment, PartTrack, SubmissionGroup


class RefundKind(models.TextChoices):
    """The giver of an attempt back."""

    PLATFORM = "platform", _("the site, after its own fault")
    TEACHER = "teacher", _("a teacher")


class RunState(models.TextChoices):
    """The states of a run of an attempt. Only ``waiting`` is not final."""

    WAITING = "waiting", _("waiting")
    FINISHED = "finished", _("finished")
    FAILED = "failed", _("failed")
    PLATFORM_FAULT = "platform_fault", _("failed by the site's fault")


class Attempt(models.Model):
    """A model that was handed in: by ``racer``, for their submission group if they are in one.

    ``number``: counts the attempts of the student or the group; ``accepted_at`` decides whether it is in time. One
    that was given back counts for no limit and no mark. One of a reference row is not a student's."""

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="attempts", verbose_name=_("assignment"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="attempts", verbose_name=_("racer")
    )
    submission_group = models.ForeignKey(
        SubmissionGroup,
        models.CASCADE,
        null=True,
        blank=True,
        related_name="attempts",
        verbose_name=_("submission group"),
    )
    model = models.ForeignKey(
        "evaluation.TrainedModel", models.PROTECT, related_name="attempts", verbose_name=_("model")
    )
    model_name = models.CharField(_("name of the model"), max_length=64)
    number = models.PositiveIntegerField(_("number"))
    is_reference = models.BooleanField(_("of a reference row"), default=False, editable=False)
    accepted_at = models.DateTimeField(_("accepted"))
    refunded_at = models.DateTimeField(_("given back"), null=True, blank=True)
    refund_kind = models.CharField(_("given back by"), max_length=8, choices=RefundKind.choices, blank=True)
    refund_reason = OneLineField(_("reason"), max_length=200, blank=True)
    refunded_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("by")
    )

    class Meta:
        verbose_name = _("attempt")
        verbose_name_plural = _("attempts")
        ordering = ["-accepted_at", "-pk"]
        indexes = [
            models.Index(fields=["assignment", "racer", "accepted_at"], name="attempts_of_a_student"),
        ]
        constraints = [
            models.UniqueConstraint(
                fields=["assignment", "racer", "is_reference", "number"],
                condition=Q(submission_group=None),
                name="attempt_number_of_racer",
            ),
            models.UniqueConstraint(
                fields=["submission_group", "number"],
                condition=Q(submission_group__isnull=False),
                name="attempt_number_of_group",
            ),
            models.CheckConstraint(
                condition=Q(refunded_at__isnull=True, refund_kind="")
                | Q(refunded_at__isnull=False, refund_kind__in=RefundKind.values),
                name="attempt_refund_has_a_kind",
            ),
            models.CheckConstraint(
                condition=Q(is_reference=False) | Q(submission_group=None), name="attempt_reference_of_nobody"
            ),
        ]

    def __str__(self) -> str:
        return self.public_id

    def get_absolute_url(self) -> str:
        return reverse("attempt", args=[self.public_id])


class AttemptRun(models.Model):
    """A run of an attempt on one track. ``laps``: a copy of the result's, which marks are computed from."""

    attempt = models.ForeignKey(Attempt, models.CASCADE, related_name="runs", verbose_name=_("attempt"))
    part_track = models.ForeignKey(PartTrack, models.CASCADE, related_name="runs", verbose_name=_("track"))
    evaluation = models.OneToOneField(
        "evaluation.Evaluation",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="attempt_run",
        verbose_name=_("evaluation"),
    )
    state = models.CharField(_("state"), max_length=14, choices=RunState.choices, default=RunState.WAITING)
    laps = models.JSONField(_("laps"), default=list, blank=True)
    ended_at = models.DateTimeField(_("ended"), null=True, blank=True)

    class Meta:
        verbose_name = _("run of an attempt")
        verbose_name_plural = _("runs of attempts")
        ordering = ["part_track__part__number", "part_track__number"]
        constraints = [
            models.UniqueConstraint(fields=["attempt", "part_track"], name="attempt_run_once"),
            models.CheckConstraint(
                condition=Q(state="waiting", ended_at__isnull=True) | ~Q(state="waiting") & Q(ended_at__isnull=False),
                name="attempt_run_ended",
            ),
            models.CheckConstraint(condition=Q(state__in=RunState.values), name="attempt_run_state_known"),
        ]

    def __str__(self) -> str:
        return f"{self.attempt_id}: {self.part_track_id}"

    @property
    def facts(self) -> Mapping[str, Any]:
        """What marks are computed from."""
        return {"track": self.part_track_id, "state": self.state, "laps": self.laps}
