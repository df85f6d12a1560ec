"""Outcomes of the rounds of a season: divisions, fields, points and stewards' decisions."""

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.models.racer import Racer
from core.database.columns import OneLineField
from races.models import Division

from .season import Round, Season


class Membership(models.Model):
    """A racer's division in a season; without one: open. ``promoted_in``: None if set by an admin or ``carried``
    over."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="memberships", verbose_name=_("season"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="memberships", verbose_name=_("racer"))
    division = models.CharField(_("division"), max_length=4, choices=Division.choices[:2], default=Division.PRO)
    since = models.DateTimeField(_("since"), default=timezone.now)
    promoted_in = models.ForeignKey(
        Round,
        models.CASCADE,
        null=True,
        blank=True,
        editable=False,
        related_name="promotions",
        verbose_name=_("promoted in"),
    )
    place = models.PositiveIntegerField(_("place in that race"), null=True, blank=True, editable=False)
    carried = models.BooleanField(_("from the season before"), default=False, db_default=False, editable=False)

    class Meta:
        verbose_name = _("division of a racer")
        verbose_name_plural = _("divisions of racers")
        ordering = ["season", "division", "racer"]
        constraints = [
            models.UniqueConstraint(fields=["season", "racer"], name="membership_one_division_a_season"),
            models.CheckConstraint(condition=Q(division__in=["open", "pro"]), name="membership_division_known"),
            models.CheckConstraint(
                condition=Q(promoted_in=None, place=None)
                | Q(promoted_in__isnull=False, place__isnull=False, division="pro"),
                name="membership_promoted_to_pro",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.get_division_display()} · {self.season}"


class FinalePlace(models.Model):
    """A racer in the field of a month's finale. ``place``: among those who could come in, from 1."""

    round = models.ForeignKey(Round, models.CASCADE, related_name="finale_places", verbose_name=_("pro race"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="finale_places", verbose_name=_("racer"))
    place = models.PositiveSmallIntegerField(_("place"))

    class Meta:
        verbose_name = _("place in a finale")
        verbose_name_plural = _("places in finales")
        ordering = ["round", "place"]
        constraints = [
            models.UniqueConstraint(fields=["round", "racer"], name="finale_place_once_a_racer"),
            models.UniqueConstraint(fields=["round", "place"], name="finale_place_once"),
            models.CheckConstraint(condition=Q(place__gte=1), name="finale_place_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.round} · {self.place}"


class ChampionshipPlace(models.Model):
    """A racer who has qualified for a season's championship, and in which finale, at what place (from 1) there."""

    season = models.ForeignKey(Season, models.CASCADE, related_name="places_held", verbose_name=_("season"))
    round = models.ForeignKey(Round, models.CASCADE, related_name="championship_places", verbose_name=_("finale"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="championship_places", verbose_name=_("racer"))
    place = models.PositiveSmallIntegerField(_("place"))

    class Meta:
        verbose_name = _("place in a championship")
        verbose_name_plural = _("places in championships")
        ordering = ["season", "round", "place"]
        constraints = [
            models.UniqueConstraint(fields=["season", "racer"], name="championship_place_once_a_racer"),
            models.UniqueConstraint(fields=["round", "place"], name="championship_place_once"),
            models.CheckConstraint(condition=Q(place__gte=1), name="championship_place_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.season}"


class RoundPoints(models.Model):
    """The points of a racer in an official round, with the country and the team that they raced for; none without
    points."""

    round = models.ForeignKey(Round, models.CASCADE, related_name="points", verbose_name=_("round"))
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="round_points", verbose_name=_("racer"))
    rank = models.PositiveSmallIntegerField(_("rank"))
    points = models.PositiveSmallIntegerField(_("points"))
    country = models.CharField(_("country"), max_length=2, blank=True)
    team = models.CharField(_("team"), max_length=64, blank=True)

    class Meta:
        verbose_name = _("points of a round")
        verbose_name_plural = _("points of rounds")
        ordering = ["round", "rank"]
        constraints = [
            models.UniqueConstraint(fields=["round", "racer"], name="round_points_once_a_racer"),
            models.UniqueConstraint(fields=["round", "rank"], name="round_points_once_a_rank"),
            models.CheckConstraint(condition=Q(rank__gte=1), name="round_points_rank_from_one"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.round} · {self.points}"


class Decision(models.TextChoices):
    """What a steward can decide about an official round."""

    DISQUALIFIED = "disqualified", _("disqualified")
    RESTORED = "restored", _("reinstated")
    REOPENED = "reopened", _("results revoked")
    LOCKED = "locked", _("results locked")


class StewardDecision(models.Model):
    """What was decided about a round, by whom and why. Rows are only ever added."""

    round = models.ForeignKey(Round, models.CASCADE, related_name="decisions", verbose_name=_("round"))
    racer = models.ForeignKey(
        Racer, models.CASCADE, null=True, blank=True, related_name="+", verbose_name=_("racer concerned")
    )
    decision = models.CharField(_("decision"), max_length=12, choices=Decision.choices)
    reason = OneLineField(_("reason"), max_length=255)
    by = models.ForeignKey(
        Racer, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("decided by")
    )
    at = models.DateTimeField(_("at"))

    class Meta:
        verbose_name = _("steward's decision")
        verbose_name_plural = _("stewards' decisions")
        ordering = ["-at", "-pk"]
        indexes = [models.Index(fields=["at"], name="decision_by_time")]
        constraints = [
            models.CheckConstraint(condition=~Q(reason=""), name="decision_has_a_reason"),
            models.CheckConstraint(condition=Q(decision__in=Decision.values), name="decision_known"),
            models.CheckConstraint(
                condition=Q(decision__in=["reopened", "locked"], racer=None)
                | ~Q(decision__in=["reopened", "locked"]) & Q(racer__isnull=False),
                name="decision_names_its_racer",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.round}: {self.get_decision_display()}"


class DuelRating(models.Model):
    """The skill that a season's duels show: openskill's ``mu`` and ``sigma`` (races.duels.ratings), computed from all
    duels."""

    # no separate index: the unique one over season and racer begins with it
    season = models.ForeignKey(
        Season, models.CASCADE, related_name="duel_ratings", verbose_name=_("season"), db_index=False
    )
    racer = models.ForeignKey(Racer, models.CASCADE, related_name="duel_ratings", verbose_name=_("racer"))
    mu = models.FloatField(_("skill"))
    sigma = models.FloatField(_("uncertainty"))
    duels = models.PositiveIntegerField(_("duels"))

    class Meta:
        verbose_name = _("rating")
        verbose_name_plural = _("ratings")
        ordering = ["season", "pk"]
        constraints = [
            models.UniqueConstraint(fields=["season", "racer"], name="rating_once_a_season"),
            models.CheckConstraint(condition=Q(sigma__gt=0, duels__gte=1), name="rating_after_a_duel"),
        ]

    def __str__(self) -> str:
        return f"{self.racer} · {self.season} · {self.shown:.1f}"

    @property
    def shown(self) -> float:
        """The skill that the racer has with near certainty: mu - 3 sigma."""
        return self.mu - 3 * self.sigma
