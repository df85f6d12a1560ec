"""Seasons, their rounds, and the rules of their stages."""

import dataclasses
from datetime import datetime, timedelta
from decimal import Decimal
from typing import Any

from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils.translation import gettext_lazy as _

from core.database.columns import MultiLineField, OneLineField
from paddock.rules.race import RULES, STAGE
from races.errors import problem
from races.models import Division, Race, RaceKind
from races.models.rules import column, inside_a_stage, laps_constraints, with_rules

# The table of a round that many championships use. Nobody is bound to it.
DEFAULT_POINTS = (25, 18, 15, 12, 10, 8, 6, 4, 2, 1)
# The standings are worked out from all places with points whenever a page shows them.
MOST_PLACES, MOST_POINTS = 200, 10_000
# Addresses below /seasons/ that are other pages.
RESERVED_SLUGS = frozenset({"new", "now"})


def default_points() -> list[int]:
    """Points by place, the winner's first."""
    return list(DEFAULT_POINTS)


class Stage(models.TextChoices):
    """What a race is in its round. The values are the words of the league's own record."""

    OPEN = "open-qualifier", _("open race")
    PRO = "pro-qualifier", _("pro race")
    FINALE = "pro-finale", _("finale")
    CHAMPIONSHIP = "championship", _("championship")
    SINGLE = "single", _("single race")


# Whose the race of a stage is. A finale's and the championship's field is given besides.
DIVISION_OF = {
    Stage.OPEN: Division.OPEN,
    Stage.PRO: Division.PRO,
    Stage.FINALE: Division.PRO,
    Stage.CHAMPIONSHIP: Division.PRO,
    Stage.SINGLE: Division.ALL,
}
# The word for a stage in addresses and names of races.
WORD_OF = {
    Stage.OPEN: "open",
    Stage.PRO: "pro",
    Stage.FINALE: "finale",
    Stage.CHAMPIONSHIP: "championship",
    Stage.SINGLE: "race",
}
WITH_POINTS = (Stage.OPEN, Stage.PRO, Stage.SINGLE)
WITH_FIELD = (Stage.FINALE, Stage.CHAMPIONSHIP)


def usual_stage(race: Race) -> Stage:
    """The default stage of a league race."""
    usual: dict[str, Stage] = {Division.OPEN: Stage.OPEN, Division.PRO: Stage.PRO}
    return usual.get(race.division, Stage.SINGLE)


class Season(models.Model):
    """A year of monthly rounds and the numbers of its rules (:mod:`league.standings.rules`). ``ends_on``: its last
    day."""

    slug = models.SlugField(_("address"), unique=True)
    name = OneLineField(_("name"), max_length=64)
    starts_on = models.DateField(_("starts"))
    ends_on = models.DateField(_("ends"))
    promotion_percent = models.DecimalField(
        _("promoted (%)"),
        max_digits=4,
        decimal_places=1,
        default=Decimal(10),
        help_text=_("Share of the classified racers of a month's open race; at least one."),
    )
    finale_size = models.PositiveSmallIntegerField(
        _("cars in a finale"), default=16, validators=[MinValueValidator(1), MaxValueValidator(1000)]
    )
    championship_places = models.PositiveSmallIntegerField(
        _("championship places per finale"),
        default=3,
        validators=[MinValueValidator(1), MaxValueValidator(1000)],
    )
    points = models.JSONField(
        _("points by place"), default=default_points, help_text=_("Winner's points first, in descending order.")
    )
    drop_worst = models.PositiveSmallIntegerField(
        _("worst results dropped"), default=0, help_text=_("A missed round counts as 0 points.")
    )
    steward_hours = models.PositiveSmallIntegerField(
        _("steward window in hours"),
        default=48,
        validators=[MaxValueValidator(24 * 60)],
        help_text=_("Results can be corrected for this long after a round has closed."),
    )
    prizes = MultiLineField(_("prizes"), blank=True, max_length=4000)
    zone = models.CharField(
        _("time zone"),
        max_length=64,
        blank=True,
        default="",
        db_default="",
        editable=False,
        help_text=_("Its races open and close by the clock of this zone; empty: the zone of the site."),
    )
    continues = models.BooleanField(
        _("continues automatically"),
        default=True,
        db_default=True,
        help_text=_("The season that follows is drafted 60 days ahead: the same races a year later."),
    )
    follows = models.OneToOneField(
        "self",
        models.SET_NULL,
        null=True,
        blank=True,
        editable=False,
        related_name="successor",
        verbose_name=_("continues the season"),
    )

    class Meta:
        verbose_name = _("season")
        verbose_name_plural = _("seasons")
        ordering = ["-starts_on"]
        constraints = [
            models.CheckConstraint(
                condition=Q(ends_on__gt=F("starts_on")),
                name="season_ends_after_start",
                violation_error_message=_("The season ends before it starts. Choose a later last day."),
            ),
            models.CheckConstraint(
                condition=Q(promotion_percent__gt=0, promotion_percent__lt=100), name="season_promotes_some_not_all"
            ),
            models.CheckConstraint(
                condition=Q(championship_places__gte=1, championship_places__lte=F("finale_size")),
                name="season_finale_holds_its_championship_places",
            ),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("season", args=[self.slug])

    @property
    def steward_window(self) -> timedelta:
        """How long after its closing a round can be corrected."""
        return timedelta(hours=self.steward_hours)

    def clean(self) -> None:
        """Refuse numbers that make no season, each on its field. Raises ValidationError of reason codes."""
        problems: dict[str, ValidationError] = {}
        if self.slug and self.slug.lower() in RESERVED_SLUGS:
            problems["slug"] = problem("season_address_reserved", season=self.slug)
        elif self.slug and Season.objects.filter(slug__iexact=self.slug).exclude(pk=self.pk).exists():
            problems["slug"] = problem("season_exists", season=self.slug)
        percent = self.promotion_percent
        if isinstance(percent, int | float | Decimal) and not _is_share(percent):
            problems["promotion_percent"] = problem("season_cut", percent=str(percent))
        if not _is_table(self.points):
            problems["points"] = problem("season_points_shape", most=MOST_POINTS, places=MOST_PLACES)
        else:
            steps = enumerate(zip(self.points, self.points[1:], strict=False), start=2)
            rise = next((place for place, (before, after) in steps if after > before), None)
            if rise is not None:
                problems["points"] = problem("season_points_rise", place=rise, points=self.points[rise - 1])
        places, size = self.championship_places, self.finale_size
        if isinstance(places, int) and isinstance(size, int) and places > size >= 1:
            problems["championship_places"] = problem("season_more_places_than_cars", size=size)
        if problems:
            raise ValidationError(problems)


def _is_share(percent: float | Decimal) -> bool:
    """More than 0 and less than 100; NaN, which as a Decimal cannot even be compared, is neither."""
    return Decimal(percent).is_finite() and 0 < percent < 100


def _is_table(points: object) -> bool:
    return (
        isinstance(points, list)
        and 1 <= len(points) <= MOST_PLACES
        and all(isinstance(one, int) and not isinstance(one, bool) and 0 <= one <= MOST_POINTS for one in points)
    )


class StageRules(with_rules(STAGE, inside_a_stage)):  # type: ignore[misc]
    """How the races of one stage of a season are ranked and limited, unless a race differs when it is made."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="stage_rules", verbose_name=_("season"))
    stage = models.CharField(_("stage"), max_length=16, choices=Stage.choices)
    max_submissions = column(dataclasses.replace(RULES["max_submissions"], default=None))

    class Meta:
        verbose_name = _("rules of a stage")
        verbose_name_plural = _("rules of stages")
        ordering = ["season", "stage"]
        constraints = [
            models.UniqueConstraint(fields=["season", "stage"], name="stage_rules_once_a_season"),
            models.CheckConstraint(condition=Q(stage__in=Stage.values), name="stage_rules_stage_known"),
            *laps_constraints("stage_rules"),
        ]

    def __str__(self) -> str:
        return f"{self.season} · {self.get_stage_display()}"

    def for_a_race(self) -> dict:
        """The fields of a race that these rules set."""
        return {name: getattr(self, name) for name in STAGE}


class Round(models.Model):
    """One race of a month of a season; races of a month share ``number``. ``closed_at``: when its results became
    official."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="rounds", verbose_name=_("season"))
    number = models.PositiveSmallIntegerField(_("number"))
    stage = models.CharField(
        _("stage"),
        max_length=16,
        choices=Stage.choices,
        blank=True,
        help_text=_("Empty: the month's open or pro race, by the race's division."),
    )
    name = OneLineField(
        _("name of the month"),
        max_length=64,
        blank=True,
        help_text=_("All races of a month share one name. A finale belongs to the qualifier with the same name."),
    )
    race = models.OneToOneField("races.Race", models.PROTECT, related_name="round", verbose_name=_("race"))
    closed_at = models.DateTimeField(_("official since"), null=True, blank=True, editable=False)
    held_at = models.DateTimeField(
        _("held back since"),
        null=True,
        blank=True,
        editable=False,
        help_text=_("A steward revoked the results. An admin must publish them again."),
    )
    locked_at = models.DateTimeField(
        _("locked"),
        null=True,
        blank=True,
        editable=False,
        help_text=_("Final from this time, even during the steward window."),
    )

    class Meta:
        verbose_name = _("round")
        verbose_name_plural = _("rounds")
        ordering = ["season", "number"]
        indexes = [models.Index(fields=["closed_at"], condition=Q(closed_at__isnull=False), name="round_by_closing")]
        constraints = [
            models.CheckConstraint(condition=Q(number__gte=1), name="round_number_from_one"),
            models.CheckConstraint(condition=Q(closed_at=None) | Q(held_at=None), name="round_official_or_held_back"),
            models.CheckConstraint(
                condition=Q(locked_at=None) | Q(closed_at__isnull=False), name="round_locked_when_official"
            ),
            models.CheckConstraint(condition=Q(stage__in=Stage.values), name="round_stage_known"),
            models.UniqueConstraint(
                fields=["season", "number", "stage"],
                name="round_one_race_of_a_stage",
                violation_error_message=_("This division already has a race in this round of the season."),
            ),
        ]

    def __str__(self) -> str:
        return f"{self.season} · {self.number}"

    def save(self, *args: Any, **kwargs: Any) -> None:
        if not self.stage and self.race_id:
            self.stage = usual_stage(self.race)
        super().save(*args, **kwargs)

    def clean(self) -> None:
        """Require a league race of the stage's division, one after the other in each stage. Raises ValidationError by
        field."""
        if self.race_id is None:
            return
        if self.race.kind != RaceKind.LEAGUE:
            raise ValidationError({"race": _("Only league races can be rounds. This is a community race.")})
        self.stage = self.stage or usual_stage(self.race)
        if self.stage in DIVISION_OF and self.race.division != DIVISION_OF[Stage(self.stage)]:
            division = Division(DIVISION_OF[Stage(self.stage)]).label
            raise ValidationError({"stage": problem("round_of_another_division", division=str(division))})
        if self.season_id is None:  # a season that is made together with its rounds
            return
        others = Round.objects.filter(season=self.season, stage=self.stage).exclude(pk=self.pk)
        if others.filter(number=self.number).exists():
            raise ValidationError({"number": _("This division already has a race in this round of the season.")})
        self.refuse_overlap()

    def refuse_overlap(self) -> None:
        """Raise ValidationError on a race that overlaps with another one of its stage; single, finale and recorded
        races may."""
        if self.stage in (Stage.SINGLE, Stage.FINALE) or self.race.imported_at is not None:
            return
        others = Round.objects.filter(season=self.season, stage=self.stage).exclude(pk=self.pk)
        overlap = others.filter(
            race__cancelled_at=None, race__opens_at__lt=self.race.closes_at, race__closes_at__gt=self.race.opens_at
        )
        other = overlap.select_related("race").first()
        if other is not None:
            raise ValidationError({"race": problem("rounds_overlap", race=self.race.name, other=other.race.name)})

    @property
    def division(self) -> str:
        """Whose race it is."""
        return DIVISION_OF[Stage(self.stage)]

    @property
    def settled_at(self) -> datetime | None:
        """When nothing changes any more: the end of the steward window, or the moment of locking. None before."""
        if self.closed_at is None:
            return None
        end = self.closed_at + self.season.steward_window
        return end if self.locked_at is None else min(end, self.locked_at)

    def is_under_review(self, now: datetime) -> bool:
        """Whether the results are official and stewards may still correct them."""
        settled = self.settled_at
        return settled is not None and now < settled
