"""Sweeps: several settings of one training that share a budget of time."""

from typing import TypedDict

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext_lazy

from core.database.columns import OneLineField
from core.ids import new_public_id
from core.jobs.models import reason_sentence

from .job import TrainingJob

SETTINGS_LEAST, SETTINGS_MOST = 2, 12
NAME_LIMIT = 58  # leaves room for the number of a trial


class SearchRange(TypedDict, total=False):
    """The values of one hyperparameter: numbers from ``low`` to ``high``, or ``choices``."""

    low: float
    high: float
    choices: list[float | str]


class ActionSpaceChoice(TypedDict):
    """An action space as ``model_metadata.json`` has it."""

    action_space_type: str
    action_space: list[dict[str, float]] | dict[str, dict[str, float]]


class SearchSpace(TypedDict):
    """What the trials of a sweep differ in. The first action space and the first reward function are those of the base
    training; one entry alone does not vary."""

    hyperparameters: dict[str, SearchRange]
    action_spaces: list[ActionSpaceChoice]
    reward_functions: list[str]


class TrialSetting(TypedDict):
    """One point of a :class:`SearchSpace`; ``action_space`` and ``reward_function`` are indexes into it."""

    hyperparameters: dict[str, float | str]
    action_space: int
    reward_function: int


class RungResult(TypedDict):
    """The best evaluation of a trial when a rung was over. ``seconds``: of training, since the trial began."""

    seconds: float
    progress: float
    lap_ms: int | None


class SweepState(models.TextChoices):
    """The states of a sweep. All but RUNNING are final."""

    RUNNING = "running", _("running")
    FINISHED = "finished", pgettext_lazy("a training", "finished")
    STOPPED = "stopped", _("stopped")
    FAILED = "failed", _("failed")


class Sweep(models.Model):
    """Several settings of one training by successive halving. Trial 1 has the base settings; the best trial becomes a
    model."""

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="sweeps", verbose_name=_("owner"))
    name = OneLineField(_("name"), max_length=NAME_LIMIT)
    space = models.JSONField(_("search space"))
    settings_count = models.PositiveSmallIntegerField(_("number of settings"))
    budget_s = models.PositiveIntegerField(_("budget in seconds"))
    seed = models.PositiveIntegerField(_("seed"), default=0)
    state = models.CharField(_("state"), max_length=8, choices=SweepState.choices, default=SweepState.RUNNING)
    stop_asked_at = models.DateTimeField(_("asked to stop"), null=True, blank=True)
    reason_code = models.CharField(_("reason"), max_length=40, blank=True)
    reason_params = models.JSONField(_("details"), default=dict, blank=True)
    best = models.ForeignKey(
        "training.SweepTrial",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("best trial"),
        db_index=False,
    )
    created_at = models.DateTimeField(_("created"), default=timezone.now)
    ended_at = models.DateTimeField(_("ended"), null=True, blank=True)

    class Meta:
        verbose_name = _("sweep")
        verbose_name_plural = _("sweeps")
        ordering = ["-created_at", "-pk"]
        indexes = [models.Index(fields=["id"], condition=Q(state="running"), name="sweeps_running")]
        constraints = [
            models.UniqueConstraint(
                fields=["owner", "name"], condition=Q(state="running"), name="sweep_name_unique_while_it_runs"
            ),
            models.CheckConstraint(condition=Q(state__in=SweepState.values), name="sweep_state_known"),
            models.CheckConstraint(
                condition=Q(state="running", ended_at__isnull=True) | (~Q(state="running") & Q(ended_at__isnull=False)),
                name="sweep_ended_when_final",
            ),
            models.CheckConstraint(
                condition=Q(settings_count__gte=SETTINGS_LEAST, settings_count__lte=SETTINGS_MOST),
                name="sweep_settings_range",
            ),
            models.CheckConstraint(condition=Q(budget_s__gte=1), name="sweep_budget_positive"),
            models.CheckConstraint(condition=~Q(state="failed") | ~Q(reason_code=""), name="sweep_failure_has_reason"),
            models.CheckConstraint(condition=~Q(state="finished") | Q(reason_code=""), name="sweep_finished_has_none"),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("sweep", args=[self.public_id])

    @property
    def is_final(self) -> bool:
        return self.state != SweepState.RUNNING

    @property
    def reason(self) -> str:
        return reason_sentence(self.reason_code, self.reason_params)


class SweepTrial(models.Model):
    """One setting of a sweep with its training. ``results``: a :class:`RungResult` for each rung that it finished."""

    sweep = models.ForeignKey(Sweep, models.CASCADE, related_name="trials", verbose_name=_("sweep"))
    number = models.PositiveSmallIntegerField(_("number"))
    setting = models.JSONField(_("setting"))
    job = models.OneToOneField(TrainingJob, models.CASCADE, related_name="trial", verbose_name=_("training job"))
    results = models.JSONField(_("results"), default=list, blank=True)

    class Meta:
        verbose_name = _("trial of a sweep")
        verbose_name_plural = _("trials of sweeps")
        ordering = ["sweep", "number"]
        constraints = [
            models.UniqueConstraint(fields=["sweep", "number"], name="trial_number_unique_in_sweep"),
            models.CheckConstraint(condition=Q(number__gte=1, number__lte=SETTINGS_MOST), name="trial_number_range"),
        ]

    def __str__(self) -> str:
        return f"{self.sweep_id}/{self.number}"
