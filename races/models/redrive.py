"""A race's reruns and changed times after a change of the engine."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from .entry import Entry
from .submission import Submission


class RedriveState(models.TextChoices):
    """PENDING until its race takes all of them together (TAKEN), or this one has become of no use (DROPPED)."""

    PENDING = "pending", _("in progress")
    TAKEN = "taken", _("applied")
    DROPPED = "dropped", _("dropped")


class Redrive(models.Model):
    """One counted run, driven again as specified. Only operators see it until its race counts it.

    ``engine``: the site's when it was queued; ``tries``: how many were queued in a row because Paddock failed.
    ``replaced``: once taken, the evaluation that the submission had before.
    """

    submission = models.ForeignKey(Submission, models.CASCADE, related_name="redrives", db_index=False)
    evaluation = models.OneToOneField("evaluation.Evaluation", models.PROTECT, related_name="redrive")
    replaced = models.OneToOneField(
        "evaluation.Evaluation", models.PROTECT, null=True, blank=True, related_name="replaced_by"
    )
    engine = models.CharField(max_length=32)
    tries = models.PositiveSmallIntegerField(default=1)
    state = models.CharField(max_length=8, choices=RedriveState.choices, default=RedriveState.PENDING)

    class Meta:
        verbose_name = _("repeated run")
        verbose_name_plural = _("repeated runs")
        indexes = [models.Index(fields=["submission", "state"], name="redrive_of_submission")]
        constraints = [
            models.UniqueConstraint(
                fields=["submission"], condition=Q(state="pending"), name="redrive_pending_once_a_submission"
            ),
            models.CheckConstraint(condition=Q(state__in=RedriveState.values), name="redrive_state_known"),
            models.CheckConstraint(
                condition=Q(state="taken", replaced__isnull=False) | ~Q(state="taken") & Q(replaced=None),
                name="redrive_taken_replaces",
            ),
            models.CheckConstraint(condition=~Q(engine="") & Q(tries__gte=1), name="redrive_for_an_engine"),
        ]

    def __str__(self) -> str:
        return f"{self.submission} {self.engine}"


class Retiming(models.Model):
    """A changed score of an entry by another engine: one for each entry and change, with the places then.

    Scores in milliseconds, None for not classified; ranks None for entries without one. ``reason_code``: why the
    counted run came to no result this time; ``""`` where it did.
    """

    entry = models.ForeignKey(Entry, models.CASCADE, related_name="retimings", db_index=False)
    at = models.DateTimeField()
    old_engine = models.CharField(max_length=32)
    new_engine = models.CharField(max_length=32)
    old_score_ms = models.PositiveIntegerField(null=True, blank=True)
    new_score_ms = models.PositiveIntegerField(null=True, blank=True)
    old_rank = models.PositiveIntegerField(null=True, blank=True)
    new_rank = models.PositiveIntegerField(null=True, blank=True)
    reason_code = models.CharField(max_length=40, blank=True)
    reason_params = models.JSONField(default=dict, blank=True)

    class Meta:
        verbose_name = _("changed time")
        verbose_name_plural = _("changed times")
        indexes = [models.Index(fields=["at"], name="retiming_by_time")]
        constraints = [
            models.UniqueConstraint(fields=["entry", "at"], name="retiming_once_a_change"),
            models.CheckConstraint(
                condition=~Q(old_score_ms=models.F("new_score_ms"))
                & ~Q(old_score_ms__isnull=True, new_score_ms__isnull=True),
                name="retiming_changes_a_score",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.entry}: {self.old_score_ms} {self.new_score_ms}"
