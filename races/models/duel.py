"""Models against models: the draw of a race, its heats, and the cars in them."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from paddock.rules.race import MAX_CARS

from .entry import Entry
from .race import Race


class Draw(models.Model):
    """The draw of a race: qualifying is over, heats are scheduled. ``entrants``: the number of seeded cars."""

    race = models.OneToOneField(Race, models.CASCADE, primary_key=True, related_name="draw", verbose_name=_("race"))
    entrants = models.PositiveSmallIntegerField(_("cars drawn"))
    drawn_at = models.DateTimeField(_("drawn"))
    over_at = models.DateTimeField(_("last duel decided"), null=True, blank=True)

    class Meta:
        verbose_name = _("draw")
        verbose_name_plural = _("draws")

    def __str__(self) -> str:
        return f"{self.race}: {self.entrants}"


class DuelState(models.TextChoices):
    """The states of a heat. DECIDED and VOID are final."""

    WAITING = "waiting", _("scheduled")
    DRIVING = "driving", _("in the queue or on track")
    DECIDED = "decided", _("decided")
    VOID = "void", _("not driven: Paddock failed")


class Duel(models.Model):
    """One heat: two to four cars in one world, or in none when all but one have left the race (a walkover).

    In a bracket, heats 2n - 1 and 2n of a round are tie n (with ties of one heat or three: n, or 3n - 2 to 3n).
    """

    # no separate index: the unique one over race, round and number begins with it
    race = models.ForeignKey(Race, models.CASCADE, related_name="duels", verbose_name=_("race"), db_index=False)
    round = models.PositiveSmallIntegerField(_("round"))
    number = models.PositiveSmallIntegerField(_("number"))
    state = models.CharField(_("state"), max_length=8, choices=DuelState.choices, default=DuelState.WAITING)
    evaluation = models.OneToOneField(
        "evaluation.Evaluation",
        models.PROTECT,
        null=True,
        blank=True,
        related_name="duel",
        verbose_name=_("evaluation"),
    )
    tries = models.PositiveSmallIntegerField(_("runs"), default=0)
    decided_at = models.DateTimeField(_("decided"), null=True, blank=True)

    class Meta:
        verbose_name = _("duel")
        verbose_name_plural = _("duels")
        ordering = ["race", "round", "number"]
        constraints = [
            models.UniqueConstraint(fields=["race", "round", "number"], name="duel_once_in_a_round"),
            models.CheckConstraint(condition=Q(round__gte=1, number__gte=1), name="duel_numbered_from_one"),
            models.CheckConstraint(condition=Q(state__in=DuelState.values), name="duel_state_known"),
            models.CheckConstraint(
                condition=Q(state__in=["decided", "void"], decided_at__isnull=False)
                | Q(state__in=["waiting", "driving"], decided_at=None),
                name="duel_decided_when_final",
            ),
            models.CheckConstraint(
                condition=~Q(state__in=["driving", "void"]) | Q(evaluation__isnull=False, tries__gte=1),
                name="duel_drives_an_evaluation",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.race} {self.round}.{self.number}"

    @property
    def is_final(self) -> bool:
        return self.state in (DuelState.DECIDED, DuelState.VOID)

    @property
    def is_walkover(self) -> bool:
        """Whether it was decided without anybody driving."""
        return self.state == DuelState.DECIDED and self.evaluation_id is None


class DuelCompetitor(models.Model):
    """A car in a heat. ``grid``: its starting place, 1 in front. ``place``, ``points``: once the heat is decided.

    ``laps`` and ``time_ms`` are of complete laps alone. ``forfeited``: its racer had left the race when the heat was
    queued, so it did not start. ``retired_code``: the reason that took it off the track.
    """

    # no separate index: the unique one over duel and entry begins with it
    duel = models.ForeignKey(Duel, models.CASCADE, related_name="cars", verbose_name=_("duel"), db_index=False)
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="duel_cars", verbose_name=_("entry"))
    grid = models.PositiveSmallIntegerField(_("starting place"))
    forfeited = models.BooleanField(_("did not start"), default=False)
    place = models.PositiveSmallIntegerField(_("place"), null=True, blank=True)
    points = models.PositiveSmallIntegerField(_("points"), null=True, blank=True)
    laps = models.PositiveSmallIntegerField(_("complete laps"), default=0)
    time_ms = models.PositiveIntegerField(_("bot time"), default=0)
    retired_code = models.CharField(_("reason for retiring"), max_length=40, blank=True)

    class Meta:
        verbose_name = _("car in a duel")
        verbose_name_plural = _("cars in duels")
        ordering = ["duel", "grid"]
        constraints = [
            models.UniqueConstraint(fields=["duel", "entry"], name="duelcompetitor_once_in_a_duel"),
            models.UniqueConstraint(fields=["duel", "grid"], name="duelcompetitor_grid_once"),
            models.UniqueConstraint(
                fields=["duel", "place"], condition=~Q(place=None), name="duelcompetitor_place_once"
            ),
            models.CheckConstraint(condition=Q(grid__gte=1, grid__lte=MAX_CARS), name="duelcompetitor_grid_range"),
            models.CheckConstraint(
                condition=Q(place=None, points=None, laps=0, time_ms=0, retired_code="")
                | Q(place__isnull=False, points__isnull=False)
                & Q(place__gte=1, place__lte=MAX_CARS, points__lte=MAX_CARS - models.F("place")),
                name="duelcompetitor_points_with_a_place",
            ),
            models.CheckConstraint(
                condition=Q(forfeited=False, retired_code="") | Q(points=None) | Q(points=0),
                name="duelcompetitor_lost_without_points",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.duel} {self.entry.racer}"

    @property
    def is_lost(self) -> bool:
        """Whether it lost by not driving to the end."""
        return self.forfeited or bool(self.retired_code)
