"""Assignments, their parts and tracks, reference rows, submission groups and extensions."""

import secrets
from decimal import Decimal

from django.conf import settings
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import MultiLineField, OneLineField
from core.ids import new_public_id
from paddock.rules.race import RaceRules

MOST_HIDDEN = 5


class Counts(models.TextChoices):
    """Which attempt counts."""

    BEST = "best", _("the best")
    LAST = "last", _("the last")
    FIRST_K = "first_k", _("the best of the first")


class Shows(models.TextChoices):
    """What students see of the results of others."""

    OWN = "own", _("only their own result")
    ANONYMOUS = "anonymous", _("a board without names")
    NAMED = "named", _("a board with names")


class TrackKind(models.TextChoices):
    """A candidate becomes drawn at the deadline; until then, and unless drawn, only teachers see it."""

    SHOWN = "shown", _("shown")
    CANDIDATE = "candidate", _("candidate")
    DRAWN = "drawn", _("drawn")


def new_seed() -> str:
    return secrets.token_hex(16)


class Assignment(models.Model):
    """A task with a deadline, for the students of a group; a class is ``group.classroom``.

    ``due_at``: what is accepted at this moment is in time. ``last_at``: until when late attempts are accepted; None:
    nothing after ``due_at``. ``draw_seed`` is secret. ``rules_version`` grows with each change that can change marks;
    ``marked_rules`` are the rules (:mod:`courses.marking`) of ``marked_version``, by which marks are computed until a
    regrade is applied."""

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    group = models.ForeignKey(
        "accounts.RacerGroup", models.CASCADE, related_name="assignments", verbose_name=_("group")
    )
    title = OneLineField(_("title"), max_length=80)
    instructions = MultiLineField(_("instructions"), blank=True, max_length=10_000)
    time_zone = models.CharField(_("time zone"), max_length=64, default="UTC")
    opens_at = models.DateTimeField(_("opens"))
    due_at = models.DateTimeField(_("due"))
    last_at = models.DateTimeField(_("late attempts until"), null=True, blank=True)
    late_points_a_day = models.DecimalField(
        _("points off for each late day"),
        max_digits=6,
        decimal_places=2,
        default=0,
        validators=[MinValueValidator(0)],
    )
    attempts_a_day = models.PositiveSmallIntegerField(
        _("attempts a day"), null=True, blank=True, validators=[MinValueValidator(1)]
    )
    attempts_in_all = models.PositiveSmallIntegerField(
        _("attempts in all"), null=True, blank=True, validators=[MinValueValidator(1)]
    )
    counts = models.CharField(_("attempt that counts"), max_length=7, choices=Counts.choices, default=Counts.BEST)
    first_k = models.PositiveSmallIntegerField(
        _("number of first attempts"), null=True, blank=True, validators=[MinValueValidator(1)]
    )
    shows = models.CharField(_("students see"), max_length=9, choices=Shows.choices, default=Shows.OWN)
    draw_seed = models.CharField(max_length=32, default=new_seed, editable=False)
    drawn_at = models.DateTimeField(_("hidden tracks drawn"), null=True, blank=True, editable=False)
    published_at = models.DateTimeField(_("published"), null=True, blank=True, editable=False)
    rules_version = models.PositiveIntegerField(_("version of the rules"), default=1, editable=False)
    marked_version = models.PositiveIntegerField(_("version of the marks"), default=1, editable=False)
    marked_rules = models.JSONField(_("rules of the marks"), default=dict, blank=True, editable=False)
    final_at = models.DateTimeField(_("marks complete"), null=True, blank=True, editable=False)
    created_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("by")
    )
    created_at = models.DateTimeField(_("created"), default=timezone.now)

    class Meta:
        verbose_name = _("assignment")
        verbose_name_plural = _("assignments")
        ordering = ["due_at", "pk"]
        indexes = [
            # the draw of hidden tracks
            models.Index(fields=["due_at"], condition=Q(drawn_at__isnull=True), name="assignment_not_drawn"),
        ]
        constraints = [
            models.CheckConstraint(condition=~Q(title=""), name="assignment_has_a_title"),
            models.CheckConstraint(condition=Q(opens_at__lt=F("due_at")), name="assignment_opens_before_due"),
            models.CheckConstraint(
                condition=Q(last_at__isnull=True) | Q(last_at__gt=F("due_at")), name="assignment_last_after_due"
            ),
            models.CheckConstraint(condition=Q(late_points_a_day__gte=0), name="assignment_late_points"),
            models.CheckConstraint(
                condition=Q(attempts_a_day__isnull=True) | Q(attempts_a_day__gte=1), name="assignment_attempts_a_day"
            ),
            models.CheckConstraint(
                condition=Q(attempts_in_all__isnull=True) | Q(attempts_in_all__gte=1), name="assignment_attempts_in_all"
            ),
            models.CheckConstraint(
                condition=Q(counts="first_k", first_k__gte=1) | Q(counts__in=["best", "last"], first_k__isnull=True),
                name="assignment_first_k",
            ),
            models.CheckConstraint(condition=Q(shows__in=Shows.values), name="assignment_shows_known"),
        ]

    def __str__(self) -> str:
        return self.title

    def get_absolute_url(self) -> str:
        return reverse("assignment", args=[self.public_id])

    @property
    def awaits_regrade(self) -> bool:
        """Whether the rules have changed since the marks were computed."""
        return self.published_at is not None and self.rules_version != self.marked_version


class AssignmentPart(models.Model):
    """What is graded apart. ``pass_rule``: a code of :data:`courses.marking.pass_rules.PASS_RULES`, with
    ``pass_params``; ``rules``: what is driven (``RaceRules.to_dict``); ``hidden_tracks``: how many of the candidates
    are drawn at the deadline."""

    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="parts", verbose_name=_("assignment"))
    number = models.PositiveSmallIntegerField(_("number"))
    title = OneLineField(_("title"), max_length=80)
    points = models.DecimalField(
        _("points"), max_digits=6, decimal_places=2, validators=[MinValueValidator(Decimal("0.01"))]
    )
    pass_rule = models.CharField(_("rule for passing"), max_length=16)
    pass_params = models.JSONField(_("values of the rule"), default=dict, blank=True)
    rules = models.JSONField(_("race rules"))
    hidden_tracks = models.PositiveSmallIntegerField(
        _("hidden tracks"), default=0, validators=[MaxValueValidator(MOST_HIDDEN)]
    )

    class Meta:
        verbose_name = _("part of an assignment")
        verbose_name_plural = _("parts of assignments")
        ordering = ["number"]
        constraints = [
            models.UniqueConstraint(fields=["assignment", "number"], name="assignment_part_number"),
            models.CheckConstraint(condition=Q(points__gt=0), name="assignment_part_points"),
            models.CheckConstraint(condition=Q(hidden_tracks__lte=MOST_HIDDEN), name="assignment_part_hidden"),
        ]

    def __str__(self) -> str:
        return self.title

    @property
    def race_rules(self) -> RaceRules:
        return RaceRules.from_dict(self.rules)


class PartTrack(models.Model):
    """A track of a part."""

    part = models.ForeignKey(AssignmentPart, models.CASCADE, related_name="tracks", verbose_name=_("part"))
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="assignment_parts", verbose_name=_("track"))
    number = models.PositiveSmallIntegerField(_("number"))
    kind = models.CharField(_("kind"), max_length=9, choices=TrackKind.choices, default=TrackKind.SHOWN)

    class Meta:
        verbose_name = _("track of an assignment")
        verbose_name_plural = _("tracks of assignments")
        ordering = ["part", "number"]
        constraints = [
            models.UniqueConstraint(fields=["part", "track"], name="part_track_once"),
            models.UniqueConstraint(fields=["part", "number"], name="part_track_number"),
            models.CheckConstraint(condition=Q(kind__in=TrackKind.values), name="part_track_kind_known"),
        ]

    def __str__(self) -> str:
        return f"{self.part_id}: {self.number}"


class ReferenceRow(models.Model):
    """A car on the board that is neither ranked nor marked, such as the teacher's. Its runs are an attempt's."""

    assignment = models.ForeignKey(
        Assignment, models.CASCADE, related_name="reference_rows", verbose_name=_("assignment")
    )
    label = OneLineField(_("label"), max_length=40)
    attempt = models.OneToOneField(
        "courses.Attempt", models.CASCADE, related_name="reference_row", verbose_name=_("attempt")
    )

    class Meta:
        verbose_name = _("reference row")
        verbose_name_plural = _("reference rows")
        ordering = ["pk"]

    def __str__(self) -> str:
        return self.label


class SubmissionGroup(models.Model):
    """Students of an assignment who submit together and have one mark."""

    assignment = models.ForeignKey(
        Assignment, models.CASCADE, related_name="submission_groups", verbose_name=_("assignment")
    )
    name = OneLineField(_("name"), max_length=40)

    class Meta:
        verbose_name = _("submission group")
        verbose_name_plural = _("submission groups")
        ordering = ["name", "pk"]
        constraints = [models.UniqueConstraint(fields=["assignment", "name"], name="submission_group_name")]

    def __str__(self) -> str:
        return self.name


class SubmissionGroupMember(models.Model):
    """A student in a submission group; in one of each assignment."""

    group = models.ForeignKey(SubmissionGroup, models.CASCADE, related_name="members", verbose_name=_("group"))
    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="+", verbose_name=_("assignment"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="submission_groups", verbose_name=_("racer")
    )

    class Meta:
        verbose_name = _("member of a submission group")
        verbose_name_plural = _("members of submission groups")
        ordering = ["pk"]
        constraints = [models.UniqueConstraint(fields=["assignment", "racer"], name="submission_group_once")]

    def __str__(self) -> str:
        return f"{self.group_id}: {self.racer_id}"


class Extension(models.Model):
    """Another deadline for one student; in a submission group the latest of its members' counts for all. Without
    ``granted_by`` the site gave it, for an attempt that failed by its fault."""

    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="extensions", verbose_name=_("assignment"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="extensions", verbose_name=_("racer")
    )
    due_at = models.DateTimeField(_("due"))
    last_at = models.DateTimeField(_("late attempts until"), null=True, blank=True)
    reason = OneLineField(_("reason"), max_length=200, blank=True)
    granted_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("by")
    )
    granted_at = models.DateTimeField(_("granted"))

    class Meta:
        verbose_name = _("extension")
        verbose_name_plural = _("extensions")
        ordering = ["pk"]
        constraints = [
            models.UniqueConstraint(fields=["assignment", "racer"], name="extension_once"),
            models.CheckConstraint(
                condition=Q(last_at__isnull=True) | Q(last_at__gt=F("due_at")), name="extension_last_after_due"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.assignment_id}: {self.racer_id}"
