"""Official results that are driven again on another worker, to see whether they come to the same."""

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.jobs.models import Job, lease_constraints


class RecheckState(models.TextChoices):
    """FINISHED with a verdict, FAILED without one."""

    QUEUED = "queued", _("queued")
    RUNNING = "running", _("on track")
    FINISHED = "finished", _("finished")
    FAILED = "failed", _("failed")


class Elsewhere(models.TextChoices):
    """How far from the run the recheck was driven, the farthest last."""

    SAME = "same", _("the same worker: there was no other")
    WORKER = "worker", _("another worker")
    MACHINE = "machine", _("another machine")
    PROCESSOR = "processor", _("another processor")


class Recheck(Job):
    """One result of a day's sample, driven again. It never changes the result.

    ``day`` and ``number``: its place in the sample; ``same``: the verdict; ``differences``: by name, the stored value
    and the measured one. The columns ``measured_*`` are the recheck's; ``worker`` drove it. ``examined_at``: an
    admin has seen to the difference, which ends the alarm.
    """

    day = models.DateField(_("day"))
    number = models.PositiveSmallIntegerField(_("number"))
    evaluation = models.ForeignKey(
        "evaluation.Evaluation", models.CASCADE, related_name="rechecks", verbose_name=_("evaluation")
    )
    state = models.CharField(_("state"), max_length=8, choices=RecheckState.choices, default=RecheckState.QUEUED)
    queued_at = models.DateTimeField(_("queued"), default=timezone.now)
    same = models.BooleanField(_("the same"), null=True, blank=True)
    differences = models.JSONField(_("differences"), default=dict, blank=True)
    measured_sha256 = models.CharField(_("sha-256 of the new trace"), max_length=64, blank=True)
    measured_engine = models.CharField(_("engine of the recheck"), max_length=32, blank=True)
    measured_cpu = models.CharField(_("processor of the recheck"), max_length=128, blank=True)
    elsewhere = models.CharField(_("driven on"), max_length=9, choices=Elsewhere.choices, blank=True)
    examined_at = models.DateTimeField(_("examined"), null=True, blank=True)

    class Meta:
        verbose_name = _("recheck")
        verbose_name_plural = _("rechecks")
        ordering = ["-day", "number"]
        constraints = [
            *lease_constraints("recheck", waiting="queued", working="running", final=["finished", "failed"]),
            # two schedulers draw the same sample, and write it once
            models.UniqueConstraint(fields=["day", "number"], name="recheck_place_in_the_sample"),
            models.UniqueConstraint(fields=["day", "evaluation"], name="recheck_once_a_day"),
            models.CheckConstraint(
                condition=Q(state="finished", same__isnull=False) | ~Q(state="finished") & Q(same__isnull=True),
                name="recheck_finished_has_a_verdict",
            ),
            models.CheckConstraint(
                condition=Q(examined_at__isnull=True) | Q(same__isnull=False, same=False),
                name="recheck_examined_if_different",
            ),
            models.CheckConstraint(
                condition=~Q(state="failed") | ~Q(reason_code=""), name="recheck_failure_has_reason"
            ),
        ]
        indexes = [
            models.Index(fields=["day"], condition=Q(same=False, examined_at__isnull=True), name="recheck_alarms")
        ]

    def __str__(self) -> str:
        return f"{self.day} {self.number}"
