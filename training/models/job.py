"""A training job, its place in the queue and its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from core.ids import new_public_id
from core.jobs.models import Job, lease_constraints, reason_sentence
from evaluation.appearance.looks import DEFAULT_COLOUR, Shell
from paddock.rules.race import MAX_BOTS, MAX_BOXES, RULES
from paddock.rules.training import DRIVEN_BY, KEPT, MOST_TRACKS, RANDOMISED, SETTINGS
from races.models.rules import name_choices, with_columns, within

from .choices import FINAL_STATES, Algorithm, BestMetric, EndReason, JobState, NeuralNetwork, RewardSignature

if TYPE_CHECKING:
    from tracks.models import Track

name_choices("best_metric", BestMetric)


_RULES = {**{name: RULES[name] for name in DRIVEN_BY}, **{name: SETTINGS[name] for name in KEPT}}


class TrainingJob(with_columns(_RULES), Job):  # type: ignore[misc]
    """One training; its settings never change, only its state and measurements.

    ``driving`` is the newest evaluation as ``[[x, y, yaw, speed], ...]``, one point a control step, in metres, radians
    and m/s. ``kills``: the ``failures`` reported by its own process.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="training_jobs", verbose_name=_("owner")
    )
    name = OneLineField(_("name"), max_length=64)
    description = OneLineField(_("description"), max_length=255, blank=True)

    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="training_jobs", verbose_name=_("track"))

    algorithm = models.CharField(_("algorithm"), max_length=3, choices=Algorithm.choices, default=Algorithm.PPO)
    hyperparameters = models.JSONField(_("hyperparameters"))
    action_space_type = models.CharField(_("kind of action space"), max_length=10)
    action_space = models.JSONField(_("action space"))
    vehicle = models.ForeignKey(
        "training.Vehicle",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="jobs",
        verbose_name=_("vehicle"),
    )
    sensors = models.JSONField(_("sensors"))
    lidar_config = models.JSONField(_("lidar settings"), default=dict, blank=True)
    neural_network = models.CharField(_("network"), max_length=40, choices=NeuralNetwork.choices)
    shell = models.CharField(_("shell"), max_length=16, choices=Shell.choices, default=Shell.PADDOCK)
    colour = models.CharField(_("colour"), max_length=7, default=DEFAULT_COLOUR)
    reward_code = models.TextField(_("reward function"))
    reward_signature = models.CharField(
        _("form of the reward function"),
        max_length=10,
        choices=RewardSignature.choices,
        default=RewardSignature.PARAMS,
    )
    seed = models.PositiveIntegerField(_("seed"), default=0)
    submit_to_race = models.ForeignKey(
        "races.Race",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="training_jobs",
        verbose_name=_("race to submit to"),
    )
    cloned_from = models.ForeignKey(
        "evaluation.TrainedModel",
        models.PROTECT,
        null=True,
        blank=True,
        related_name="clones",
        verbose_name=_("cloned from"),
    )

    state = models.CharField(_("state"), max_length=8, choices=JobState.choices, default=JobState.QUEUED)
    stop_asked_at = models.DateTimeField(_("asked to stop"), null=True, blank=True)
    stopped_by = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("stopped by"),
    )
    progress = models.JSONField(_("progress"), default=dict, blank=True)
    driving = models.JSONField(_("newest drive"), default=list, blank=True)
    seen = models.JSONField(
        _("what a car sees"),
        default=dict,
        blank=True,
        db_default={},
        help_text=_("While running: camera picture (PNG, base64), next action and expected reward."),
    )
    stop_seconds = models.FloatField(
        _("time limit in seconds"),
        null=True,
        blank=True,
        help_text=_("Of a trial of a sweep, up to the end of its rung; in place of the minutes."),
    )
    keeps_models = models.BooleanField(
        _("keeps its models"),
        default=True,
        db_default=True,
        help_text=_("Not for a trial of a sweep that may continue: it keeps its checkpoint."),
    )
    steps_done = models.PositiveIntegerField(_("steps driven"), default=0)
    seconds_done = models.FloatField(_("seconds of training"), default=0.0)
    reward_ms = models.FloatField(
        _("milliseconds of a call of the reward function"),
        null=True,
        blank=True,
        help_text=_("The average of all calls, in processor time."),
    )
    charged_s = models.FloatField(
        _("seconds charged"),
        default=0.0,
        db_default=0.0,
        help_text=_(
            "From each claim to its end, by the database's clock; of lost attempts what a checkpoint has kept."
        ),
    )
    failures = models.PositiveSmallIntegerField(
        _("failures"), default=0, db_default=0, help_text=_("Faults of ours in a row, since it last got further.")
    )
    got_to = models.PositiveIntegerField(
        _("got to"), default=0, db_default=0, help_text=_("The iteration of its newest checkpoint when it last failed.")
    )
    best_model = models.ForeignKey(
        "evaluation.TrainedModel",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="best_of_jobs",
        verbose_name=_("best model"),
    )
    last_model = models.ForeignKey(
        "evaluation.TrainedModel",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="last_of_jobs",
        verbose_name=_("last model"),
    )
    sb3_zip = models.FileField(_("stable-baselines3 model"), upload_to="training/", blank=True)
    log = models.TextField(_("log"), blank=True)
    printed = models.TextField(_("newest lines that the reward function printed"), blank=True)
    submission = models.OneToOneField(
        "races.Submission",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="training_job",
        verbose_name=_("submission"),
    )
    evaluate_on = models.ForeignKey(
        "tracks.Track",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("track to evaluate on when done"),
        db_index=False,  # queried only when a track or a run is deleted
    )
    own_evaluation = models.ForeignKey(
        "races.OwnEvaluation",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("test run"),
        db_index=False,
    )
    evaluate_reason_code = models.CharField(
        _("not evaluated because"), max_length=40, blank=True, default="", db_default=""
    )
    evaluate_reason_params = models.JSONField(_("details"), default=dict, blank=True, db_default={})
    submit_reason_code = models.CharField(_("reason for not submitting"), max_length=40, blank=True)
    submit_reason_params = models.JSONField(_("details"), default=dict, blank=True)
    ended_because = models.CharField(_("why it ended"), max_length=10, choices=EndReason.choices, blank=True)
    created_at = models.DateTimeField(_("created"), default=timezone.now)
    deleted_at = models.DateTimeField(
        _("deleted"),
        null=True,
        blank=True,
        help_text=_("Its row stays until its month is over, for its minutes count."),
    )

    class Meta:
        verbose_name = _("training job")
        verbose_name_plural = _("training jobs")
        ordering = ["-created_at", "-pk"]
        indexes = [
            models.Index(fields=["created_at", "id"], condition=Q(state="queued"), name="training_queue"),
            models.Index(fields=["leased_until"], condition=Q(state="running"), name="training_leases"),
        ]
        constraints = [
            *lease_constraints(
                "training", waiting="queued", working="running", final=["finished", "failed", "stopped"]
            ),
            models.UniqueConstraint(
                fields=["owner", "name"],
                condition=Q(state__in=["queued", "running"]),
                name="training_name_unique_while_it_runs",
            ),
            models.CheckConstraint(condition=Q(name__regex=r"^[A-Za-z0-9-]{1,64}$"), name="training_name_form"),
            models.CheckConstraint(
                condition=Q(state__in=["queued", "running"], ended_because="")
                | Q(state="finished", ended_because__in=["time", "steps", "clean_laps"])
                | Q(state="stopped", ended_because="stopped")
                | Q(state="failed", ended_because="failed"),
                name="training_end_has_reason",
            ),
            models.CheckConstraint(
                condition=~Q(state="failed") | ~Q(reason_code=""), name="training_failure_has_reason"
            ),
            models.CheckConstraint(
                condition=~Q(state="finished") | Q(steps_done__gt=0), name="training_finished_has_steps"
            ),
            models.CheckConstraint(
                condition=Q(race_type="time_trial", boxes=[], random_boxes=0, bots=0)
                | Q(race_type="object_avoidance", bots=0, random_boxes__gte=1, random_boxes__lte=MAX_BOXES, boxes=[])
                | Q(race_type="object_avoidance", bots=0, random_boxes=0) & ~Q(boxes=[])
                | Q(race_type="head_to_head", boxes=[], random_boxes=0, bots__gte=1, bots__lte=MAX_BOTS),
                name="training_race_type_options",
            ),
            models.CheckConstraint(condition=within("bot_speed_mps"), name="training_bot_speed_range"),
            models.CheckConstraint(
                condition=Q(algorithm="ppo", action_space_type__in=["discrete", "continuous"])
                | Q(algorithm="sac", action_space_type="continuous"),
                name="training_algorithm_takes_action_space",
            ),
            models.CheckConstraint(condition=within("stop_minutes", SETTINGS), name="training_minutes_range"),
            models.CheckConstraint(
                condition=Q(stop_steps__isnull=True) | Q(stop_steps__gte=1), name="training_steps_positive"
            ),
            models.CheckConstraint(
                condition=Q(stop_clean_laps__isnull=True) | within("stop_clean_laps", SETTINGS),
                name="training_clean_laps_range",
            ),
            models.CheckConstraint(condition=within("trials", SETTINGS), name="training_trials_range"),
            *(
                models.CheckConstraint(condition=within(name, SETTINGS), name=f"training_{name}_range")
                for name in RANDOMISED
            ),
            models.CheckConstraint(condition=Q(best_metric__in=BestMetric.values), name="training_best_metric_known"),
            models.CheckConstraint(condition=~Q(reward_code=""), name="training_has_reward_function"),
            models.CheckConstraint(condition=Q(charged_s__gte=0), name="training_charged_seconds_positive"),
            models.CheckConstraint(
                condition=Q(stop_seconds__isnull=True, keeps_models=True) | Q(stop_seconds__gt=0),
                name="training_trial_has_seconds",
            ),
            models.CheckConstraint(
                condition=Q(deleted_at__isnull=True)
                | Q(state__in=["finished", "failed", "stopped"], best_model=None, last_model=None, sb3_zip="", log=""),
                name="training_deleted_leaves_nothing",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("training", args=[self.public_id])

    @property
    def is_final(self) -> bool:
        return self.state in FINAL_STATES

    @property
    def limit_s(self) -> float:
        """The time limit in seconds."""
        return self.stop_minutes * 60.0 if self.stop_seconds is None else self.stop_seconds

    @property
    def submit_reason(self) -> str:
        return reason_sentence(self.submit_reason_code, self.submit_reason_params)

    @property
    def evaluate_reason(self) -> str:
        return reason_sentence(self.evaluate_reason_code, self.evaluate_reason_params)

    @property
    def tracks(self) -> list[Track]:
        more = self.more_tracks.select_related("track").order_by("place")
        return [self.track, *(one.track for one in more)]

    @property
    def randomised(self) -> dict[str, int]:
        """What its episodes draw anew, as percentages above 0 by the names of the settings."""
        return {name: getattr(self, name) for name in RANDOMISED if getattr(self, name)}

    @property
    def metadata(self) -> dict:
        metadata = {
            "action_space": self.action_space,
            "action_space_type": self.action_space_type,
            "sensor": self.sensors,
            "neural_network": self.neural_network,
            "training_algorithm": "sac" if self.algorithm == Algorithm.SAC else "clipped_ppo",
            "version": "5",
        }
        if self.lidar_config:
            metadata["lidar_config"] = self.lidar_config
        return metadata


class TrainingTrack(models.Model):
    """One more track of a training, beside ``TrainingJob.track``; its place counts from 1."""

    job = models.ForeignKey(TrainingJob, models.CASCADE, related_name="more_tracks", verbose_name=_("training job"))
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="+", verbose_name=_("track"))
    place = models.PositiveSmallIntegerField(_("place"))

    class Meta:
        verbose_name = _("more tracks of a training")
        verbose_name_plural = _("more tracks of trainings")
        ordering = ["job", "place"]
        constraints = [
            models.UniqueConstraint(fields=["job", "track"], name="training_track_once"),
            models.UniqueConstraint(fields=["job", "place"], name="training_track_place_once"),
            models.CheckConstraint(condition=Q(place__gte=1, place__lt=MOST_TRACKS), name="training_track_place_range"),
        ]

    def __str__(self) -> str:
        return f"{self.job_id}/{self.place}"
