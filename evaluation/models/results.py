"""The tables of results: one row for each finished run and one for each rival."""

from __future__ import annotations

import uuid

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.jobs.models import reason_sentence
from paddock.rules.race import MAX_CARS

from .evaluations import Evaluation
from .stored_files import SHA256


def alone() -> list[int]:
    return [0]


class OpenResults(models.Manager["Result"]):
    def get_queryset(self) -> models.QuerySet[Result]:
        return super().get_queryset().filter(evaluation__sealed=False)


class CompetitorResult(models.Model):
    """The result of one car of an evaluation.

    ``laps``: LapResult dicts in order (times in whole simulated milliseconds). ``trajectory``: per lap a list of [x, y,
    speed] in metres and m/s, thinned for drawing. ``retired_code``: why a car with rivals was taken off the track, or
    ``""``.
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
    """The result of a finished evaluation, written once by the worker that held the lease.

    Its own columns are car 0's; other cars are rows of :class:`RivalResult`. ``order``: the numbers of all cars, winner
    first. ``layout``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}, ...]}``; ``bots``: the poses of bot cars, a
    gzipped file. :func:`evaluation.running.results.read_layout` has both.
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
