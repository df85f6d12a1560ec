"""Trained models, evaluations and their results. The table of evaluations is the queue."""

from __future__ import annotations

import uuid

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.ids import new_public_id
from core.jobs.models import Job, lease_constraints, reason_sentence
from paddock.rules.race import MAX_CARS

from .looks import COLOUR, DEFAULT_COLOUR, Shell, VehicleLook

SHA256 = r"^[0-9a-f]{64}$"


def alone() -> list[int]:
    """The order at the end of a run with one car."""
    return [0]


class Damage(models.TextChoices):
    """What was found of a stored file that is not what was stored."""

    MISSING = "missing", _("missing")
    ALTERED = "altered", _("altered")


class StoredFile(models.Model):
    """The sum of a stored file's bytes, and what was last found of it.

    ``sha256``: ``""`` only for one that was found damaged before its sum was known. ``checked_at``: when the nightly
    check last read it; None for one whose turn has not come.
    """

    name = models.CharField(_("name"), max_length=255, primary_key=True)
    sha256 = models.CharField(_("sha-256"), max_length=64, blank=True)
    size = models.PositiveBigIntegerField(_("bytes"))
    checked_at = models.DateTimeField(_("checked"), null=True, blank=True, db_index=True)
    damage = models.CharField(_("damage"), max_length=8, choices=Damage.choices, blank=True)
    damaged_at = models.DateTimeField(_("damage found"), null=True, blank=True)

    class Meta:
        verbose_name = _("stored file")
        verbose_name_plural = _("stored files")
        indexes = [models.Index(fields=["damaged_at"], condition=~Q(damage=""), name="storedfile_damaged")]
        constraints = [
            models.CheckConstraint(
                condition=Q(sha256__regex=SHA256) | Q(sha256="") & ~Q(damage=""), name="storedfile_sha256_form"
            ),
            models.CheckConstraint(
                condition=Q(damage="", damaged_at__isnull=True) | Q(damage__in=Damage.values, damaged_at__isnull=False),
                name="storedfile_damage_has_time",
            ),
        ]

    def __str__(self) -> str:
        return self.name


class Network(models.Model):
    """The canonical bytes that run, stored once however many racers upload them. ``sha256`` is a model's identity.

    ``facts``: as in :class:`paddock.network.bound.NetworkFacts`; None for one that was admitted before there were any.
    """

    sha256 = models.CharField(_("sha-256"), max_length=64, primary_key=True)
    onnx = models.FileField(_("canonical ONNX"), upload_to="networks/")
    size = models.PositiveIntegerField(_("bytes"))
    parameters = models.PositiveIntegerField(_("weights"))
    macs = models.PositiveBigIntegerField(_("multiplications per step"))
    facts = models.JSONField(
        _("facts"),
        null=True,
        blank=True,
        help_text=_("Arithmetic properties measured on upload. Empty: measured at each start."),
    )
    created_at = models.DateTimeField(_("first seen"), default=timezone.now)

    class Meta:
        verbose_name = _("network")
        verbose_name_plural = _("networks")
        constraints = [models.CheckConstraint(condition=Q(sha256__regex=SHA256), name="network_sha256_form")]

    def __str__(self) -> str:
        return self.sha256[:12]


class TrainedModel(models.Model):
    """A racer's model: a trained network with its metadata. Immutable but for its name, description and look.

    Deleting one hides it from its owner's garage (``deleted_at``); results that stand on boards stay. ``shared_at``:
    since when its owner lets every racer look at it, download it and train on from its weights; None while they do not.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="models", verbose_name=_("owner"))
    name = models.CharField(_("name"), max_length=64)
    description = models.CharField(_("description"), max_length=255, blank=True)
    network = models.ForeignKey(Network, models.PROTECT, related_name="models", verbose_name=_("network"))
    metadata = models.JSONField(_("model metadata"))
    shell = models.CharField(_("shell"), max_length=16, choices=Shell.choices, default=Shell.PADDOCK)
    colour = models.CharField(_("colour"), max_length=7, default=DEFAULT_COLOUR)
    source_kind = models.CharField(_("uploaded as"), max_length=16)
    source_sha256 = models.CharField(_("sha-256 of the upload"), max_length=64)
    source_file = models.FileField(
        _("uploaded file"),
        upload_to="uploads/",
        max_length=255,
        blank=True,
        default="",
        db_default="",
        help_text=_("Empty for models trained here, and for uploads from before files were kept."),
    )
    source_name = models.CharField(_("file name of the upload"), max_length=255, blank=True, default="", db_default="")
    created_at = models.DateTimeField(_("uploaded"), default=timezone.now)
    deleted_at = models.DateTimeField(_("deleted"), null=True, blank=True)
    shared_at = models.DateTimeField(_("shared"), null=True, blank=True)

    class Meta:
        verbose_name = _("model")
        verbose_name_plural = _("models")
        ordering = ["-created_at", "-pk"]
        indexes = [
            # the page of shared models: the latest first
            models.Index(fields=["-shared_at", "-id"], condition=Q(shared_at__isnull=False), name="model_shared"),
        ]
        constraints = [
            models.CheckConstraint(
                condition=Q(deleted_at=None) | Q(shared_at=None), name="model_deleted_is_not_shared"
            ),
            models.UniqueConstraint(
                fields=["owner", "network"], condition=Q(deleted_at=None), name="model_uploaded_once_by_owner"
            ),
            models.UniqueConstraint(
                fields=["owner", "name"], condition=Q(deleted_at=None), name="model_name_unique_for_owner"
            ),
            models.CheckConstraint(condition=Q(shell__in=Shell.values), name="model_shell_known"),
            models.CheckConstraint(condition=Q(colour__regex=COLOUR), name="model_colour_form"),
            models.CheckConstraint(condition=Q(source_sha256__regex=SHA256), name="model_source_sha256_form"),
            models.CheckConstraint(
                condition=Q(source_kind__in=["onnx", "tensorflow", "sb3"]), name="model_source_kind_known"
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("model", args=[self.public_id])

    @property
    def look(self) -> VehicleLook:
        """What the car looks like in replays."""
        return VehicleLook(self.shell, self.colour)

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors that the network reads."""
        return list(self.metadata["sensor"])


class State(models.TextChoices):
    """The states of an evaluation. FINISHED, FAILED and STOPPED are final."""

    QUEUED = "queued", _("queued")
    RUNNING = "running", _("on track")
    FINISHED = "finished", _("finished")
    FAILED = "failed", _("failed")
    STOPPED = "stopped", _("stopped")


FINAL_STATES = (State.FINISHED, State.FAILED, State.STOPPED)


class OpenRuns(models.Manager["Evaluation"]):
    """Every run but the sealed ones."""

    def get_queryset(self) -> models.QuerySet[Evaluation]:
        return super().get_queryset().filter(sealed=False)


class OpenResults(models.Manager["Result"]):
    """Every result but those of sealed runs."""

    def get_queryset(self) -> models.QuerySet[Result]:
        return super().get_queryset().filter(evaluation__sealed=False)


class Evaluation(Job):
    """One run of one network on one track under one set of rules, and its place in the queue.

    ``spec`` is frozen when the row is made: ``{"track": fingerprint, "rules": RaceRules.to_dict(), "metadata": ...}``.
    Cars that race along are rows of :class:`EvaluationRival`, made with it and frozen likewise.
    A worker claims a row by a guarded UPDATE that writes its lease; every later write names that lease.
    After a fault of ours it waits again, and is not claimed before ``not_before``.

    A ``sealed`` run is computed before it is shown. Until it is unsealed nobody knows of it, staff included:
    ``objects`` is without it, so that whoever lists runs or results must ask for ``with_sealed`` by name to find it.
    Only what computes, keeps and plays runs does.
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
            # what has ended of late, for whoever tells of it
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

    def __str__(self) -> str:
        return self.public_id

    def get_absolute_url(self) -> str:
        return reverse("evaluation", args=[self.public_id])

    @property
    def is_final(self) -> bool:
        """Whether nothing will change any more."""
        return self.state in FINAL_STATES


class EvaluationRival(models.Model):
    """Another submitted car in the same world: car ``number``, where the evaluation's own model is car 0.

    Written with the evaluation and never changed. ``metadata``: the model's, frozen as in ``Evaluation.spec``.
    """

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


class CompetitorResult(models.Model):
    """What one car of an evaluation did.

    ``laps``: a list of LapResult dicts in order (times in whole simulated milliseconds).
    ``trajectory``: per lap a list of [x, y, speed] points in metres and m/s, thinned for drawing.
    ``retired_code``: why a car that was not alone on the track was taken off it; ``""`` for one that raced to the end.
    """

    laps = models.JSONField(_("laps"))
    trajectory = models.JSONField(_("trajectory"), default=list)
    end_reason = models.CharField(_("reason for ending"), max_length=32)
    retired_code = models.CharField(_("reason for retiring"), max_length=40, blank=True)
    retired_params = models.JSONField(_("details"), default=dict, blank=True)
    complete_laps = models.PositiveSmallIntegerField(_("complete laps"))
    best_lap_ms = models.PositiveIntegerField(_("best lap"), null=True, blank=True)
    total_ms = models.PositiveIntegerField(_("total"))
    off_tracks = models.PositiveIntegerField(_("off tracks"), default=0)
    crashes = models.PositiveIntegerField(_("crashes"), default=0)
    resets = models.PositiveIntegerField(_("resets"), default=0)
    trace = models.FileField(_("trace"), upload_to="traces/")
    trace_sha256 = models.CharField(_("sha-256 of the trace"), max_length=64)
    metrics = models.JSONField(_("metrics"))

    class Meta:
        abstract = True
        constraints = [
            models.CheckConstraint(condition=Q(trace_sha256__regex=SHA256), name="%(class)s_trace_sha256_form"),
            models.CheckConstraint(
                # not null by name: a comparison with null is neither true nor false, and a check lets that pass
                condition=Q(complete_laps=0, best_lap_ms__isnull=True)
                | Q(complete_laps__gt=0, best_lap_ms__isnull=False, best_lap_ms__gt=0),
                name="%(class)s_best_lap_needs_a_lap",
            ),
            models.CheckConstraint(
                condition=Q(end_reason="retired") & ~Q(retired_code="") | ~Q(end_reason="retired") & Q(retired_code=""),
                name="%(class)s_retired_for_a_reason",
            ),
        ]

    @property
    def retired(self) -> str:
        """Why it was taken off the track, in the reader's language, or ``""``."""
        return reason_sentence(self.retired_code, self.retired_params)


class Result(CompetitorResult):
    """What one finished evaluation measured. Written once, by the worker that held the lease; never changed.

    Its own columns are car 0's, the evaluation's own model; other submitted cars are rows of :class:`RivalResult`.
    ``order``: the numbers of all cars, winner first. ``layout``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"},
    ...]}``; ``bots``: the poses of bot cars, a gzipped file. :func:`evaluation.services.results.read_layout` has both.
    """

    evaluation = models.OneToOneField(Evaluation, models.CASCADE, related_name="result", verbose_name=_("evaluation"))
    lease = models.UUIDField(_("lease"), default=uuid.uuid4, editable=False)
    order = models.JSONField(_("order"), default=alone)
    layout = models.JSONField(_("layout"), default=dict, blank=True)
    bots = models.FileField(_("bot cars"), upload_to="traces/", blank=True)
    simulated_ms = models.PositiveIntegerField(_("simulated"))
    wall_s = models.FloatField(_("wall seconds"))
    peak_mb = models.FloatField(_("peak memory"))
    engine = models.CharField(_("engine"), max_length=32)
    versions = models.JSONField(_("library versions"))
    cpu_model = models.CharField(_("processor"), max_length=128, blank=True)
    created_at = models.DateTimeField(_("recorded"), default=timezone.now)

    objects = OpenResults()
    with_sealed = models.Manager["Result"]()

    class Meta(CompetitorResult.Meta):
        verbose_name = _("result")
        verbose_name_plural = _("results")

    def __str__(self) -> str:
        return f"{self.evaluation} {self.trace_sha256[:12]}"


class RivalResult(CompetitorResult):
    """What another submitted car did in the same run; ``number`` as in :class:`EvaluationRival`."""

    result = models.ForeignKey(Result, models.CASCADE, related_name="rivals", verbose_name=_("result"))
    number = models.PositiveSmallIntegerField(_("number"))

    class Meta(CompetitorResult.Meta):
        verbose_name = _("result of a rival")
        verbose_name_plural = _("results of rivals")
        ordering = ["result", "number"]
        constraints = [
            *CompetitorResult.Meta.constraints,
            models.UniqueConstraint(fields=["result", "number"], name="rivalresult_number_unique"),
            models.CheckConstraint(condition=Q(number__gte=1, number__lt=MAX_CARS), name="rivalresult_number_in_range"),
        ]

    def __str__(self) -> str:
        return f"{self.result} {self.number}"


class WorkerNode(models.Model):
    """A worker that was seen, for the operators' page. Not a lock.

    ``seen_at``: its last heartbeat, in the database's time; ``queues``: what it listens to; ``processes``: how many
    jobs it runs at once; ``stopped_at``: when it was shut down in good order, None for one that runs or that died.
    ``sandbox``: what :class:`evaluation.sandbox.probe.SandboxReport` says, ``proof``: what
    :class:`evaluation.proof.Proof` does, with ``allowed``, whether it works though it is not exact. Empty for one that
    runs no stranger's code, and before the first time that it looked for work.
    """

    name = models.CharField(_("name"), max_length=128, unique=True)
    seen_at = models.DateTimeField(_("last seen"), db_index=True)
    started_at = models.DateTimeField(_("started"), null=True, blank=True)
    stopped_at = models.DateTimeField(_("shut down"), null=True, blank=True)
    queues = models.JSONField(_("queues"), default=list, blank=True)
    processes = models.PositiveSmallIntegerField(_("processes"), default=1)
    sandbox = models.JSONField(_("sandbox"), default=dict, blank=True)
    proof = models.JSONField(_("golden runs"), default=dict, blank=True)
    engine = models.CharField(_("engine"), max_length=32, blank=True)

    class Meta:
        verbose_name = _("worker")
        verbose_name_plural = _("workers")
        ordering = ["-seen_at"]

    def __str__(self) -> str:
        return self.name

    @property
    def refuses(self) -> bool:
        """Whether it takes no work: its sandbox is not good enough, or its golden runs differ."""
        if not self.sandbox.get("sufficient", True):
            return True
        return not (self.proof.get("exact", True) or self.proof.get("allowed", False))


# a part of this room in a folder of its own, whose tables Django finds here
from .reports import models as _reports  # noqa: E402, F401
