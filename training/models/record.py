"""Records of a running training: iterations of its graph, and checkpoints."""

from typing import TypedDict

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from .job import TrainingJob


class SightDocument(TypedDict):
    """What a car of a running training sees: a grey PNG as base64, degrees, m/s, the expected reward."""

    png: str
    steering: float
    speed: float
    value: float | None


class TrainingProgress(TypedDict, total=False):
    """``TrainingJob.progress`` of a running training; ``seen`` goes into a column of that name."""

    steps: int
    seconds: float
    iteration: int
    steps_per_second: float
    reward_ms: float
    seen: SightDocument


class TrainingIteration(models.Model):
    """One update of the policy (late in a long training a few together) and the evaluation that followed it.

    ``episodes``: the training episodes since the one before, ``eval_trials``: the trials of the evaluation, both as
    :class:`training.trainer.messages.EpisodeReport`.
    ``simtrace``: the newest of those episodes in the columns of the field's sim-trace, a gzipped CSV; ``""`` once it
    was cleared away.
    """

    job = models.ForeignKey(TrainingJob, models.CASCADE, related_name="iterations", verbose_name=_("training job"))
    number = models.PositiveIntegerField(_("number"))
    steps = models.PositiveIntegerField(_("steps so far"))
    seconds = models.FloatField(_("seconds so far"))
    steps_per_second = models.FloatField(_("steps a second"), default=0.0)
    episodes = models.JSONField(_("episodes"), default=list)
    mean_reward = models.FloatField(_("mean reward of an episode"), null=True)
    mean_progress = models.FloatField(_("mean progress of an episode in percent"), null=True)
    eval_trials = models.JSONField(_("trials of the evaluation"), default=list)
    eval_progress = models.FloatField(_("mean progress of the evaluation in percent"))
    eval_reward = models.FloatField(_("mean reward of the evaluation"))
    eval_lap_ms = models.PositiveIntegerField(_("mean lap of the evaluation"), null=True)
    eval_clean_laps = models.PositiveSmallIntegerField(_("clean laps of the evaluation"), default=0)
    entropy = models.FloatField(_("entropy"), null=True)
    policy_loss = models.FloatField(_("policy loss"), null=True)
    value_loss = models.FloatField(_("value loss"), null=True)
    is_best = models.BooleanField(_("best so far"), default=False)
    simtrace = models.FileField(_("sim-trace"), upload_to="training/", blank=True)

    class Meta:
        verbose_name = _("iteration")
        verbose_name_plural = _("iterations")
        ordering = ["job", "number"]
        constraints = [
            models.UniqueConstraint(fields=["job", "number"], name="iteration_number_unique_in_job"),
            models.CheckConstraint(
                condition=Q(eval_progress__gte=0, eval_progress__lte=100), name="iteration_progress_is_percent"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.job_id}/{self.number}"


class Checkpoint(models.Model):
    """The learner's whole state after an iteration. The newest two of a running job are kept, none of an ended one.

    ``networks``: a zip with the best and the last policy at that time as ONNX, for the worker that resumes.
    """

    job = models.ForeignKey(TrainingJob, models.CASCADE, related_name="checkpoints", verbose_name=_("training job"))
    iteration = models.PositiveIntegerField(_("iteration"))
    steps = models.PositiveIntegerField(_("steps so far"))
    seconds = models.FloatField(_("seconds so far"))
    file = models.FileField(_("state"), upload_to="training/")
    networks = models.FileField(_("networks"), upload_to="training/", blank=True)
    created_at = models.DateTimeField(_("written at"), default=timezone.now)

    class Meta:
        verbose_name = _("checkpoint")
        verbose_name_plural = _("checkpoints")
        ordering = ["job", "-iteration"]
        constraints = [models.UniqueConstraint(fields=["job", "iteration"], name="checkpoint_unique_in_job")]

    def __str__(self) -> str:
        return f"{self.job_id}/{self.iteration}"
