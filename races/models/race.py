"""A race: where, how, when, and how it is ranked."""

from __future__ import annotations

from datetime import datetime

from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from core.validators import ONE_LINE
from paddock.simulator.rules import RaceRules
from tracks.models import Direction

from ..errors import problem
from ..sensors import OFFERABLE, sensors_make_sense
from . import course
from .choices import Division, DuelFormat, Kind, Opponents, RaceState, RaceType, RankingMethod, Visibility


def _are(kind: type, *values: object) -> bool:
    return all(isinstance(value, kind) for value in values)


def _unless_imported(*constraints: models.CheckConstraint) -> list[models.CheckConstraint]:
    """The same constraints for races that are driven here; what was driven elsewhere is as it was recorded."""
    return [
        models.CheckConstraint(condition=Q(imported_at__isnull=False) | one.condition, name=one.name)
        for one in constraints
    ]


def new_invitation() -> str:
    """A secret that joins an invitation race (32 characters, 190 bits)."""
    return get_random_string(32)


def default_sensors() -> list[str]:
    """The sensors that a race offers unless told otherwise."""
    return ["FRONT_FACING_CAMERA"]


class Race(models.Model):
    """A race: where, how, when, and how it is ranked. It is open as a function of the time (:meth:`state_at`)."""

    slug = models.SlugField(_("address"), unique=True, max_length=80)
    kind = models.CharField(_("kind"), max_length=9, choices=Kind.choices, default=Kind.COMMUNITY)
    division = models.CharField(_("division"), max_length=4, choices=Division.choices, blank=True)
    name = models.CharField(_("name"), max_length=64, validators=[ONE_LINE])
    description = models.TextField(_("description"), blank=True, max_length=2000)
    organiser = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="organised_races",
        verbose_name=_("organiser"),
    )
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="races", verbose_name=_("track"))
    direction = models.CharField(_("direction"), max_length=3, choices=Direction.choices, default=Direction.CCW)
    race_type = models.CharField(_("race type"), max_length=16, choices=RaceType.choices, default=RaceType.TIME_TRIAL)
    sensors = models.JSONField(_("sensors offered"), default=default_sensors)
    ranking_method = models.CharField(
        _("ranking"), max_length=8, choices=RankingMethod.choices, default=RankingMethod.AVERAGE
    )
    laps = models.PositiveSmallIntegerField(
        _("laps driven"), default=RaceRules.laps, validators=[MinValueValidator(1), MaxValueValidator(20)]
    )
    minimum_laps = models.PositiveSmallIntegerField(
        _("consecutive complete laps needed"),
        default=RaceRules.laps,
        validators=[MinValueValidator(1), MaxValueValidator(20)],
        help_text=_("The window that the average is taken over, and what a car must finish to be classified."),
    )
    off_track_penalty_ms = models.PositiveIntegerField(
        _("off-track penalty in milliseconds"),
        default=RaceRules.off_track_penalty_ms,
        validators=[MaxValueValidator(60_000)],
    )
    collision_penalty_ms = models.PositiveIntegerField(
        _("collision penalty in milliseconds"),
        default=RaceRules.collision_penalty_ms,
        validators=[MaxValueValidator(60_000)],
    )
    max_resets = models.PositiveIntegerField(
        _("resets allowed"),
        default=RaceRules.max_resets,
        validators=[MaxValueValidator(10_000)],
        help_text=_("0: the first fault ends the run."),
    )
    max_simulated_ms = models.PositiveIntegerField(
        _("time limit in simulated milliseconds"),
        default=RaceRules.max_simulated_ms,
        validators=[MinValueValidator(10_000), MaxValueValidator(1_200_000)],
    )
    max_submissions = models.PositiveSmallIntegerField(
        _("submissions for each racer"), default=50, validators=[MinValueValidator(1), MaxValueValidator(1000)]
    )
    shared_cars = models.BooleanField(
        _("one car may race for several racers"),
        default=False,
        db_default=False,
        help_text=_("For teams and classes. Otherwise whoever sent a car first keeps its place."),
    )
    boxes = models.JSONField(
        _("boxes in fixed places"),
        default=list,
        blank=True,
        help_text=_('A list of {"fraction": share of the lap from the finish line, "lane": "inner" or "outer"}.'),
    )
    random_boxes = models.PositiveSmallIntegerField(_("boxes in places drawn from the seed"), default=0)
    box_distance_m = models.FloatField(
        _("least distance between drawn boxes in metres"), default=RaceRules.box_distance_m
    )
    opponents = models.CharField(_("opponents"), max_length=6, choices=Opponents.choices, blank=True)
    bots = models.PositiveSmallIntegerField(_("bot cars"), default=0)
    bot_speed_mps = models.FloatField(_("speed of the bot cars in m/s"), default=RaceRules.bot_speed_mps)
    bot_lane_changes = models.BooleanField(
        _("bot cars change lanes"), default=False, help_text=_("At moments drawn from the seed.")
    )
    duel_format = models.CharField(_("duels"), max_length=11, choices=DuelFormat.choices, blank=True)
    duel_cars = models.PositiveSmallIntegerField(_("cars in a duel"), default=2)
    seed = models.PositiveIntegerField(_("seed"), default=0, validators=[MaxValueValidator(2**31 - 1)])
    visibility = models.CharField(_("visibility"), max_length=10, choices=Visibility.choices, default=Visibility.PUBLIC)
    invitation = models.CharField(_("invitation"), max_length=32, unique=True, default=new_invitation, editable=False)
    opens_at = models.DateTimeField(_("opens"))
    closes_at = models.DateTimeField(_("closes"))
    cancelled_at = models.DateTimeField(_("cancelled"), null=True, blank=True, editable=False)
    cancel_reason = models.CharField(_("reason for cancelling"), max_length=255, blank=True, editable=False)
    created_at = models.DateTimeField(_("created"), default=timezone.now, editable=False)
    imported_at = models.DateTimeField(
        _("imported"),
        null=True,
        blank=True,
        editable=False,
        help_text=_("Driven elsewhere: its results came as a record, without submissions."),
    )

    # The fastest that a classified car of anybody ranked has driven, for the purple marks of a board. Written with the
    # standings.
    fastest_lap_ms = models.PositiveIntegerField(_("fastest lap"), null=True, blank=True, editable=False)
    fastest_sector_1_ms = models.PositiveIntegerField(_("fastest sector 1"), null=True, blank=True, editable=False)
    fastest_sector_2_ms = models.PositiveIntegerField(_("fastest sector 2"), null=True, blank=True, editable=False)
    fastest_sector_3_ms = models.PositiveIntegerField(_("fastest sector 3"), null=True, blank=True, editable=False)

    # A race has one engine: that of its counted results. The first of them says which; see races.services.redrives.
    engine = models.CharField(_("engine"), max_length=32, blank=True, editable=False)
    next_engine = models.CharField(
        _("driven again with"),
        max_length=32,
        blank=True,
        editable=False,
        help_text=_("The engine that all counted runs are being driven again with; empty when none are."),
    )

    class Meta:
        verbose_name = _("race")
        verbose_name_plural = _("races")
        ordering = ["-opens_at", "pk"]
        indexes = [
            models.Index(fields=["closes_at", "opens_at"], name="race_by_time"),
            models.Index(fields=["cancelled_at"], condition=Q(cancelled_at__isnull=False), name="race_by_cancelling"),
            models.Index(fields=["next_engine"], condition=~Q(next_engine=""), name="race_driven_again"),
        ]
        constraints = [
            models.CheckConstraint(condition=Q(closes_at__gt=F("opens_at")), name="race_closes_after_opening"),
            models.CheckConstraint(
                condition=Q(minimum_laps__gte=1, minimum_laps__lte=F("laps")), name="race_minimum_laps_within_laps"
            ),
            models.CheckConstraint(condition=Q(max_submissions__gte=1), name="race_allows_a_submission"),
            models.CheckConstraint(
                condition=Q(max_simulated_ms__gte=10_000, max_simulated_ms__lte=1_200_000), name="race_time_limit_range"
            ),
            *_unless_imported(
                models.CheckConstraint(condition=Q(laps__gte=1, laps__lte=20), name="race_laps_range"),
                models.CheckConstraint(
                    condition=~Q(ranking_method="total") | Q(minimum_laps=F("laps")), name="race_total_needs_all_laps"
                ),
                models.CheckConstraint(
                    condition=Q(off_track_penalty_ms__lte=60_000, collision_penalty_ms__lte=60_000),
                    name="race_penalty_range",
                ),
                *course.CONSTRAINTS,
            ),
            models.CheckConstraint(condition=Q(next_engine="") | ~Q(engine=""), name="race_driven_again_was_driven"),
            models.CheckConstraint(
                condition=Q(kind="league") & ~Q(division="") & Q(visibility="public")
                | Q(kind="community", division=""),
                name="race_league_has_division_and_is_public",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("race", args=[self.slug])

    def clean(self) -> None:
        """Refuse contradictions that need no clock, on the field to change. Raises ValidationError of reason codes."""
        problems: dict[str, ValidationError] = {}
        # full_clean comes here even when a field holds no value of its type
        if _are(datetime, self.opens_at, self.closes_at) and self.closes_at <= self.opens_at:
            problems["closes_at"] = problem("race_closes_before_opening")
        if _are(int, self.laps, self.minimum_laps):
            if self.minimum_laps > self.laps:
                problems["minimum_laps"] = problem("race_minimum_laps", laps=self.laps)
            elif self.ranking_method == RankingMethod.TOTAL and self.minimum_laps != self.laps:
                problems["minimum_laps"] = problem("race_total_needs_all_laps", laps=self.laps)
        if self.kind == Kind.LEAGUE:
            if not self.division:
                problems["division"] = problem("race_needs_division")
            if self.visibility != Visibility.PUBLIC:
                problems["visibility"] = problem("race_league_is_public")
        elif self.division:
            problems["division"] = problem("race_community_has_no_division")
        if not sensors_make_sense(self.sensors):
            problems["sensors"] = problem("race_sensors", known=", ".join(OFFERABLE))
        if self.track_id is not None and not self.track.has_shape:
            problems["track"] = problem("race_track_without_shape", track=self.track.name)
        problems |= course.problems_of(self)
        if problems:
            raise ValidationError(problems)

    @property
    def fastest_sectors_ms(self) -> tuple[int | None, int | None, int | None]:
        """The best time that anybody ranked has driven in each sector."""
        return self.fastest_sector_1_ms, self.fastest_sector_2_ms, self.fastest_sector_3_ms

    def state_at(self, now: datetime) -> RaceState:
        """Upcoming before ``opens_at``, open until just before ``closes_at``, closed from then on."""
        if self.cancelled_at is not None:
            return RaceState.CANCELLED
        if now < self.opens_at:
            return RaceState.UPCOMING
        return RaceState.OPEN if now < self.closes_at else RaceState.CLOSED
