"""A car's report: what is driven, the chunks in which workers drive it, and what came of each lap."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.ids import new_public_id
from core.jobs.models import Job, lease_constraints, reason_sentence
from paddock.errors.reasons import REASONS
from paddock.rules.race import DIRECTIONS
from paddock.rules.report import MOST_SEED, VARIATIONS

from .evaluations import FINAL_STATES, State
from .stored_files import SHA256

UNDER_WAY = (State.QUEUED, State.RUNNING)


class TrackSet(models.TextChoices):
    LEAGUE = "league", _("the tracks of the league")
    CATALOGUE = "catalogue", _("all tracks of the catalogue")
    CHOSEN = "chosen", _("chosen tracks")
    NONE = "none", _("none")


class CarReport(models.Model):
    """A racer's report on a model. Private; counted in no race.

    ``variations_on``: the track of the varied laps, in ``direction``, from ``seed``; None for none. ``rules``: of each
    lap. ``runs_sha256``: see ``digest_of`` in ``reports.grading``. A deleted report keeps its row, without laps, for a
    day: it counts for so long.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="car_reports", verbose_name=_("owner")
    )
    model = models.ForeignKey(
        "evaluation.TrainedModel", models.PROTECT, related_name="car_reports", verbose_name=_("model")
    )
    track_set = models.CharField(_("tracks"), max_length=9, choices=TrackSet.choices)
    variations_on = models.ForeignKey(
        "tracks.Track",
        models.PROTECT,
        null=True,
        blank=True,
        related_name="varied_reports",
        verbose_name=_("variations on"),
    )
    direction = models.CharField(_("direction"), max_length=3, blank=True)
    seed = models.PositiveIntegerField(_("seed"), default=0)
    rules = models.JSONField(_("rules"))
    state = models.CharField(_("state"), max_length=8, choices=State.choices, default=State.QUEUED)
    reason_code = models.CharField(_("reason"), max_length=40, blank=True)
    reason_params = models.JSONField(_("details"), default=dict, blank=True)
    engine = models.CharField(_("engine"), max_length=32, blank=True)
    grade = models.CharField(_("grade"), max_length=1, blank=True)
    runs_sha256 = models.CharField(_("sha-256 of the runs"), max_length=64, blank=True)
    asked_at = models.DateTimeField(_("requested at"), default=timezone.now)
    started_at = models.DateTimeField(_("started"), null=True, blank=True)
    ended_at = models.DateTimeField(_("ended"), null=True, blank=True)
    deleted_at = models.DateTimeField(_("deleted"), null=True, blank=True)

    class Meta:
        verbose_name = _("car's report")
        verbose_name_plural = _("cars' reports")
        ordering = ["-asked_at", "-pk"]
        indexes = [models.Index(fields=["owner", "-asked_at", "-id"], name="report_of_a_racer")]
        constraints = [
            models.CheckConstraint(condition=Q(state__in=State.values), name="report_state_known"),
            models.CheckConstraint(condition=Q(track_set__in=TrackSet.values), name="report_track_set_known"),
            models.CheckConstraint(
                condition=Q(variations_on=None, direction="")
                | Q(variations_on__isnull=False, direction__in=DIRECTIONS),
                name="report_variations_have_a_way",
            ),
            models.CheckConstraint(
                condition=Q(variations_on__isnull=False) | ~Q(track_set=TrackSet.NONE), name="report_drives_something"
            ),
            models.CheckConstraint(condition=Q(seed__lte=MOST_SEED), name="report_seed_range"),
            models.CheckConstraint(
                condition=Q(state__in=FINAL_STATES, ended_at__isnull=False) | Q(state__in=UNDER_WAY, ended_at=None),
                name="report_ended_when_final",
            ),
            models.CheckConstraint(
                condition=Q(state=State.FINISHED, runs_sha256__regex=SHA256) & ~Q(engine="")
                | ~Q(state=State.FINISHED) & Q(runs_sha256="", grade=""),
                name="report_finished_has_a_hash",
            ),
            models.CheckConstraint(
                condition=~Q(state=State.FAILED) | ~Q(reason_code=""), name="report_failure_has_reason"
            ),
            models.CheckConstraint(
                condition=Q(deleted_at=None) | Q(state__in=FINAL_STATES), name="report_deleted_is_over"
            ),
        ]

    def __str__(self) -> str:
        return self.public_id

    def get_absolute_url(self) -> str:
        return reverse("report", args=[self.public_id])

    @property
    def is_final(self) -> bool:
        return self.state in FINAL_STATES

    @property
    def way(self) -> str:
        """The direction of the varied laps in words; ``""`` without any."""
        return self.variations_on.way(self.direction) if self.variations_on is not None else ""

    @property
    def reason(self) -> str:
        """Why it failed, in the reader's language, or ``""``."""
        return reason_sentence(self.reason_code, self.reason_params)

    @property
    def is_platform_fault(self) -> bool:
        return self.state == State.FAILED and REASONS[self.reason_code].fault == "platform"


class ReportChunk(Job):
    """Some laps of a report, which one worker drives in one pair of processes; the table is their queue. ``progress``:
    laps done. ``engine``: that drove them."""

    report = models.ForeignKey(CarReport, models.CASCADE, related_name="chunks", verbose_name=_("report"))
    number = models.PositiveSmallIntegerField(_("number"))
    state = models.CharField(_("state"), max_length=8, choices=State.choices, default=State.QUEUED)
    progress = models.PositiveSmallIntegerField(_("progress"), default=0)
    engine = models.CharField(_("engine"), max_length=32, blank=True)

    class Meta:
        verbose_name = _("chunk of a report")
        verbose_name_plural = _("chunks of reports")
        ordering = ["report", "number"]
        indexes = [
            models.Index(fields=["number", "id"], condition=Q(state="queued"), name="chunk_queue"),
            models.Index(fields=["leased_until"], condition=Q(state="running"), name="chunk_leases"),
        ]
        constraints = [
            *lease_constraints("chunk", waiting="queued", working="running", final=["finished", "failed", "stopped"]),
            models.UniqueConstraint(fields=["report", "number"], name="chunk_number_unique"),
            models.CheckConstraint(condition=~Q(state="failed") | ~Q(reason_code=""), name="chunk_failure_has_reason"),
        ]

    def __str__(self) -> str:
        return f"{self.report_id}.{self.number}"


class ReportLap(models.Model):
    """One lap of a report: where, under which variation (None: as it is), and what came of it once it is driven."""

    report = models.ForeignKey(CarReport, models.CASCADE, related_name="laps", verbose_name=_("report"))
    chunk = models.ForeignKey(ReportChunk, models.CASCADE, related_name="laps", verbose_name=_("chunk"))
    number = models.PositiveSmallIntegerField(_("number"))
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="report_laps", verbose_name=_("track"))
    direction = models.CharField(_("direction"), max_length=3)
    variation = models.PositiveSmallIntegerField(_("variation"), null=True, blank=True)
    complete = models.BooleanField(_("complete"), null=True, blank=True)
    time_ms = models.PositiveIntegerField(_("time"), null=True, blank=True)
    percent = models.FloatField(_("share of the lap"), null=True, blank=True)
    status = models.CharField(_("ended as"), max_length=32, blank=True)
    x = models.FloatField(_("x"), null=True, blank=True)
    y = models.FloatField(_("y"), null=True, blank=True)
    trace_sha256 = models.CharField(_("sha-256 of the trace"), max_length=64, blank=True)

    class Meta:
        verbose_name = _("lap of a report")
        verbose_name_plural = _("laps of reports")
        ordering = ["report", "number"]
        constraints = [
            models.UniqueConstraint(fields=["report", "number"], name="report_lap_number_unique"),
            models.CheckConstraint(condition=Q(direction__in=DIRECTIONS), name="report_lap_direction_known"),
            models.CheckConstraint(
                condition=Q(variation=None) | Q(variation__lt=VARIATIONS), name="report_lap_variation_range"
            ),
            models.CheckConstraint(
                condition=Q(complete=None, time_ms=None, percent=None, x=None, y=None, status="", trace_sha256="")
                | Q(
                    complete__isnull=False,
                    time_ms__isnull=False,
                    percent__gte=0,
                    percent__lte=100,
                    x__isnull=False,
                    y__isnull=False,
                    trace_sha256__regex=SHA256,
                )
                & ~Q(status=""),
                name="report_lap_driven_or_not",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.report_id}.{self.number}"
