"""A race: where, how, when, and how it is ranked."""

from __future__ import annotations

from datetime import datetime
from functools import reduce
from operator import and_

from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from core.database.columns import MultiLineField, OneLineField
from core.database.constraints import ChecksTogether
from paddock.rules.race import PENALTIES, RULES
from paddock.rules.ranked import counts_all_laps

from ..errors import problem
from . import layout
from .choices import Division, RaceKind, RaceState, RaceType, TeamEntries, Visibility
from .rules import inside_a_race, lap_problems, laps_constraints, with_rules, within
from .sensors import OFFERABLE, sensors_make_sense


def _are(kind: type, *values: object) -> bool:
    return all(isinstance(value, kind) for value in values)


def _unless_imported(*constraints: models.CheckConstraint) -> list[models.CheckConstraint]:
    """The same constraints for races driven here; imported races stay as recorded."""
    return [
        models.CheckConstraint(
            condition=Q(imported_at__isnull=False) | one.condition,  # type: ignore[operator]  # any condition is taken
            name=one.name,
        )
        for one in constraints
    ]


_NEEDED_WITHIN_DRIVEN, *_LAPS = laps_constraints("race")


MOST_TERMS = 8000
# Of a race with real cars: how long a racer's session and a lap may last.
SESSION_S = (30, 3600)
MINIMUM_LAP_MS = (500, 60_000)
LONGEST_LAP_MS = 1_200_000


def new_invitation() -> str:
    """A secret that joins an invitation race (32 characters, 190 bits)."""
    return get_random_string(32)


# Addresses below /races/ that pages use for something else.
RESERVED_SLUGS = frozenset({"new", "create", "layout", "edit", "invitation", "invited", "join", "mine", "api"})


class Race(ChecksTogether, with_rules(RULES, inside_a_race)):  # type: ignore[misc]
    """A race: where, how, when, and how it is ranked. It is open as a function of the time (:meth:`state_at`)."""

    slug = models.SlugField(_("address"), unique=True, max_length=80)
    kind = models.CharField(_("kind"), max_length=9, choices=RaceKind.choices, default=RaceKind.COMMUNITY)
    division = models.CharField(_("division"), max_length=4, choices=Division.choices, blank=True)
    name = OneLineField(_("name"), max_length=64)
    description = MultiLineField(_("description"), blank=True, max_length=2000)
    prize = OneLineField(
        _("prize"), blank=True, max_length=200, default="", db_default="", help_text=_("One line, for the race card.")
    )
    sponsor = OneLineField(_("sponsor"), blank=True, max_length=64, default="", db_default="")
    terms = MultiLineField(
        _("terms to accept"),
        blank=True,
        max_length=MOST_TERMS,
        default="",
        db_default="",
        help_text=_("Racers must accept them before joining. After a change, everyone must accept them again."),
    )
    terms_version = models.PositiveSmallIntegerField(
        _("version of the terms"), default=0, db_default=0, editable=False, help_text=_("0: none to accept.")
    )
    organiser = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="organised_races",
        verbose_name=_("organiser"),
    )
    track = models.ForeignKey("tracks.Track", models.PROTECT, related_name="races", verbose_name=_("track"))
    group = models.ForeignKey(
        "accounts.RacerGroup",
        models.PROTECT,
        null=True,
        blank=True,
        related_name="races",
        verbose_name=_("for a group alone"),
        help_text=_("Only its confirmed members may enter. Empty: everybody."),
    )
    team_entries = models.CharField(
        _("teams"), max_length=7, choices=TeamEntries.choices, blank=True, default=TeamEntries.NONE, db_default=""
    )
    visibility = models.CharField(_("visibility"), max_length=10, choices=Visibility.choices, default=Visibility.PUBLIC)
    invitation = models.CharField(_("invitation"), max_length=32, unique=True, default=new_invitation, editable=False)
    spectator_edition = models.PositiveIntegerField(
        _("edition of the spectators' link"), default=0, db_default=0, editable=False
    )
    physical = models.BooleanField(
        _("real cars, timed at the track"),
        default=False,
        db_default=False,
        help_text=_("Real cars: timekeepers or sensors record the times."),
    )
    session_s = models.PositiveSmallIntegerField(
        _("session"),
        default=180,
        db_default=180,
        validators=[MinValueValidator(SESSION_S[0]), MaxValueValidator(SESSION_S[1])],
        help_text=_("Session length in seconds. A lap in progress at the end still counts."),
    )
    minimum_lap_ms = models.PositiveIntegerField(
        _("shortest possible lap"),
        default=3000,
        db_default=3000,
        validators=[MinValueValidator(MINIMUM_LAP_MS[0]), MaxValueValidator(MINIMUM_LAP_MS[1])],
        help_text=_("Milliseconds. Two crossings closer together than this are one."),
    )
    beside = models.ForeignKey(
        "self",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="physical_races",
        verbose_name=_("simulated counterpart"),
        help_text=_("Its results are shown beside those of the real cars."),
    )
    opens_at = models.DateTimeField(_("opens"))
    closes_at = models.DateTimeField(_("closes"))
    cancelled_at = models.DateTimeField(_("cancelled"), null=True, blank=True, editable=False)
    cancel_reason = OneLineField(_("reason for cancelling"), max_length=255, blank=True, editable=False)
    created_at = models.DateTimeField(_("created"), default=timezone.now, editable=False)
    imported_at = models.DateTimeField(
        _("imported"),
        null=True,
        blank=True,
        editable=False,
        help_text=_("Imported race: results without submissions."),
    )

    # The fastest that a classified car of anybody ranked has driven, for the purple marks of a board. Written with the
    # standings.
    fastest_lap_ms = models.PositiveIntegerField(_("fastest lap"), null=True, blank=True, editable=False)
    fastest_sector_1_ms = models.PositiveIntegerField(_("fastest sector 1"), null=True, blank=True, editable=False)
    fastest_sector_2_ms = models.PositiveIntegerField(_("fastest sector 2"), null=True, blank=True, editable=False)
    fastest_sector_3_ms = models.PositiveIntegerField(_("fastest sector 3"), null=True, blank=True, editable=False)

    day_of_ranks = models.DateField(_("day of ranks"), null=True, blank=True, editable=False)

    # A race has one engine: that of its first counted result; see races.entries.services.redrives.
    engine = models.CharField(_("engine"), max_length=32, blank=True, editable=False)
    next_engine = models.CharField(
        _("being repeated with"),
        max_length=32,
        blank=True,
        editable=False,
        help_text=_("New engine during a repetition of all counted runs; otherwise empty."),
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
            _NEEDED_WITHIN_DRIVEN,
            models.CheckConstraint(condition=Q(max_submissions__gte=1), name="race_allows_a_submission"),
            models.CheckConstraint(condition=within("max_simulated_ms"), name="race_time_limit_range"),
            *_unless_imported(
                *_LAPS,
                models.CheckConstraint(
                    condition=reduce(and_, map(within, PENALTIES)),
                    name="race_penalty_range",
                ),
                *layout.CONSTRAINTS,
            ),
            models.CheckConstraint(
                condition=Q(physical=False) | ~Q(race_type="head_to_head") & Q(engine=""), name="race_physical_is_alone"
            ),
            models.CheckConstraint(
                condition=Q(session_s__gte=SESSION_S[0], session_s__lte=SESSION_S[1])
                & Q(minimum_lap_ms__gte=MINIMUM_LAP_MS[0], minimum_lap_ms__lte=MINIMUM_LAP_MS[1]),
                name="race_timing_range",
            ),
            models.CheckConstraint(
                condition=Q(beside=None) | Q(physical=True) & ~Q(beside=F("id")), name="race_beside_of_real_cars"
            ),
            models.CheckConstraint(condition=Q(next_engine="") | ~Q(engine=""), name="race_driven_again_was_driven"),
            models.CheckConstraint(
                condition=Q(kind="league") & ~Q(division="") & Q(visibility="public")
                | Q(kind="community", division=""),
                name="race_league_has_division_and_is_public",
            ),
        ]

    def get_race_type_display(self) -> str:
        """As Django's, which looks through all choices each time."""
        return str(RaceType(self.race_type).label)

    def __str__(self) -> str:
        return self.name

    def _may_stand_beside(self, other: Race) -> bool:
        """Whether it is a simulated race on the same track that everybody sees or the same racer organises."""
        same = other.track_id == self.track_id and not other.physical
        seen = other.visibility == Visibility.PUBLIC or (
            other.organiser_id is not None and other.organiser_id == self.organiser_id
        )
        return same and seen

    def get_absolute_url(self) -> str:
        return reverse("race", args=[self.slug])

    def clean(self) -> None:
        """Refuse contradictions that need no clock, on the field to change. Raises ValidationError of reason codes."""
        problems: dict[str, ValidationError] = {}
        # full_clean comes here even when a field holds no value of its type
        if _are(datetime, self.opens_at, self.closes_at) and self.closes_at <= self.opens_at:
            problems["closes_at"] = problem("race_closes_before_opening")
        problems |= lap_problems(self)
        if self._state.adding and self.slug and self.slug.lower() in RESERVED_SLUGS:
            problems["slug"] = problem("race_address_reserved", slug=self.slug)
        if self.physical and self.race_type == RaceType.HEAD_TO_HEAD:
            problems["race_type"] = problem("race_physical_alone")
        beside = self.beside
        if beside is not None and not (self.physical and self._may_stand_beside(beside)):
            problems["beside"] = problem("race_beside")
        if self.kind == RaceKind.LEAGUE:
            if not self.division:
                problems["division"] = problem("race_needs_division")
            if self.visibility != Visibility.PUBLIC:
                problems["visibility"] = problem("race_league_is_public")
        elif self.division:
            problems["division"] = problem("race_community_has_no_division")
        if self.group is not None and not self.group.is_listed and self.visibility == Visibility.PUBLIC:
            problems["group"] = problem("race_group_is_private")
        if not sensors_make_sense(self.sensors):
            problems["sensors"] = problem("race_sensors", known=", ".join(OFFERABLE))
        if self.track_id is not None and not self.track.has_shape:
            problems["track"] = problem("race_track_without_shape", track=self.track.name)
        problems |= layout.problems_of(self)
        if problems:
            raise ValidationError(problems)

    @property
    def counts_all_laps(self) -> bool:
        return counts_all_laps(self.ranking_method)

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
