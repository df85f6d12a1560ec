"""The table of evaluations, which is the queue of runs, and of the rivals in a run."""

from __future__ import annotations

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.ids import new_public_id
from core.jobs.models import Job, lease_constraints
from paddock.rules.race import MAX_CARS

from .trained_models import TrainedModel


class State(models.TextChoices):
    """The states of an evaluation. FINISHED, FAILED and STOPPED are final."""

    QUEUED = "queued", _("queued")
    RUNNING = "running", _("on track")
    FINISHED = "finished", _("finished")
    FAILED = "failed", _("failed")
    STOPPED = "stopped", _("stopped")


FINAL_STATES = (State.FINISHED, State.FAILED, State.STOPPED)


class OpenRuns(models.Manager["Evaluation"]):
    def get_queryset(self) -> models.QuerySet[Evaluation]:
        return super().get_queryset().filter(sealed=False)


class Evaluation(Job):
    """One run of one network on one track under one set of rules, and its place in the queue.

    ``spec`` is frozen: ``{"track": fingerprint, "rules": RaceRules.to_dict(), "metadata": ...}``. Other cars are rows
    of :class:`EvaluationRival`. A worker claims a row by a guarded UPDATE that writes its lease. After a platform fault
    it waits until ``not_before``.

    A ``sealed`` run is computed before it is shown: ``objects`` excludes it, and only the code that computes, stores
    and plays runs uses ``with_sealed``.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="evaluations", verbose_name=_("owner")
    )
    model = models.ForeignKey(TrainedModel, models.PROTECT, related_name="evaluations", verbose_name=_("model"))
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="evaluations", verbose_name=_("track"))
    spec = models.JSONField(_("specification"))
    priority = models.SmallIntegerField(_("priority"), default=0, help_text=_("Higher runs first."))
    turn = models.PositiveIntegerField(_("turn"), null=True, blank=True, help_text=_("Lower runs first."))
    urgent_from = models.DateTimeField(_("priority raised at"), null=True, blank=True)

    sealed = models.BooleanField(
        _("sealed"),
        default=False,
        db_default=False,
        editable=False,
        help_text=_("Computed before the show and kept secret until then."),
    )

    state = models.CharField(_("state"), max_length=8, choices=State.choices, default=State.QUEUED)
    progress = models.JSONField(_("progress"), default=dict, blank=True)
    queued_at = models.DateTimeField(_("queued"), default=timezone.now)

    objects = OpenRuns()
    with_sealed = models.Manager["Evaluation"]()

    class Meta:
        verbose_name = _("evaluation")
        verbose_name_plural = _("evaluations")
        ordering = ["-queued_at", "-pk"]
        indexes = [
            # claim: the next row in the queue
            models.Index(
                fields=["-priority", "turn", "queued_at", "id"], condition=Q(state="queued"), name="evaluation_in_turn"
            ),
            # the same without what pauses
            models.Index(
                fields=["-priority", "turn", "queued_at", "id"],
                condition=Q(state="queued", not_before__isnull=True),
                name="evaluation_ready",
            ),
            models.Index(fields=["not_before"], condition=Q(not_before__isnull=False), name="evaluation_pausing"),
            # sweep: what has begun to hurry
            models.Index(
                fields=["urgent_from"],
                condition=Q(state="queued", urgent_from__isnull=False),
                name="evaluation_urgent_from",
            ),
            # readiness: since when somebody waits (-20: nobody does)
            models.Index(
                fields=["queued_at"], condition=Q(state="queued", priority__gt=-20), name="evaluation_waiting_since"
            ),
            # the turn that is being run, and the last that a racer had
            models.Index(
                fields=["priority", "turn"], condition=Q(started_at__isnull=False), name="evaluation_round_begun"
            ),
            models.Index(
                fields=["owner", "priority", "turn"],
                condition=Q(started_at__isnull=False),
                name="evaluation_turns_begun",
            ),
            models.Index(fields=["priority"], condition=Q(state="running"), name="evaluation_running"),
            # sweep: what a site of before there were turns has queued, during an upgrade
            models.Index(
                fields=["priority"], condition=Q(state="queued", turn__isnull=True), name="evaluation_without_turn"
            ),
            # sweep: leases that ran out
            models.Index(fields=["leased_until"], condition=Q(state="running"), name="evaluation_leases"),
            # recently ended runs, for notices
            models.Index(fields=["ended_at"], condition=Q(ended_at__isnull=False), name="evaluation_by_end"),
        ]
        constraints = [
            *lease_constraints(
                "evaluation", waiting="queued", working="running", final=["finished", "failed", "stopped"]
            ),
            models.CheckConstraint(
                condition=~Q(state="failed") | ~Q(reason_code=""), name="evaluation_failure_has_reason"
            ),
            models.CheckConstraint(
                condition=Q(not_before__isnull=True) | Q(failed_at__isnull=False),
                name="evaluation_pauses_after_our_fault",
            ),
            models.CheckConstraint(condition=Q(kills__lte=models.F("attempt")), name="evaluation_kills_of_attempts"),
            # racers take turns: one evaluation of each in a round
            models.UniqueConstraint(
                fields=["owner", "priority", "turn"], condition=Q(state="queued"), name="evaluation_one_in_a_turn"
            ),
        ]

    def get_state_display(self) -> str:  # type: ignore[no-redef]  # of the stubs
        """As Django's, which looks through all choices each time."""
        return str(State(self.state).label)

    def __str__(self) -> str:
        return self.public_id

    def get_absolute_url(self) -> str:
        return reverse("evaluation", args=[self.public_id])

    @property
    def is_final(self) -> bool:
        return self.state in FINAL_STATES


class EvaluationRival(models.Model):
    """Another submitted car in the same world: car ``number``; the evaluation's own model is car 0. Written with the
    evaluation and never changed. ``metadata``: the model's, frozen as in ``Evaluation.spec``."""

    evaluation = models.ForeignKey(Evaluation, models.CASCADE, related_name="rivals", verbose_name=_("evaluation"))
    number = models.PositiveSmallIntegerField(_("number"))
    model = models.ForeignKey(TrainedModel, models.PROTECT, related_name="rival_evaluations", verbose_name=_("model"))
    metadata = models.JSONField(_("model metadata"))

    class Meta:
        verbose_name = _("rival")
        verbose_name_plural = _("rivals")
        ordering = ["evaluation", "number"]
        constraints = [
            models.UniqueConstraint(fields=["evaluation", "number"], name="rival_number_unique"),
            models.CheckConstraint(condition=Q(number__gte=1, number__lt=MAX_CARS), name="rival_number_in_range"),
            models.CheckConstraint(condition=~Q(metadata={}), name="rival_has_metadata"),
        ]

    def __str__(self) -> str:
        return f"{self.evaluation} {self.number}"
