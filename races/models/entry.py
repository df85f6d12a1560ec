"""A race's entries and their standings."""

from django.conf import settings
from django.db import models
from django.db.models import F, Q
from django.db.models.functions import Coalesce
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from ..ranks import LAST, LIVE_LEAD, MOST_DRIVEN, NO_LAP_MS, NO_RESULT, NOT_CLASSIFIED, SEEDS
from .race import Race

# The largest submission number: the limit of a race without one.
MOST_SUBMISSIONS = 32_000


class Entry(models.Model):
    """A racer in a race, with their standing: the best counted submission, and once duels are drawn their points.

    ``races.entries.services`` alone writes the standing, with the result. A board reads one index in order
    (races.boards.ranking). A withdrawn or removed racer keeps the row and all results, and is on no board.
    """

    # no separate index: the unique one over race and racer begins with it
    race = models.ForeignKey(Race, models.CASCADE, related_name="entries", verbose_name=_("race"), db_index=False)
    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="entries", verbose_name=_("racer"))
    entered_at = models.DateTimeField(_("entered"), default=timezone.now)
    withdrawn_at = models.DateTimeField(_("withdrawn"), null=True, blank=True)
    removed_at = models.DateTimeField(_("removed by the organiser"), null=True, blank=True)
    removal_reason = OneLineField(_("reason for removing"), max_length=255, blank=True)
    is_baseline = models.BooleanField(_("house car, not ranked"), default=False)

    submission_count = models.PositiveSmallIntegerField(
        _("submissions"), default=0, help_text=_("Counted submissions, without refunded ones.")
    )
    last_number = models.PositiveSmallIntegerField(
        _("last submission number"), default=0, help_text=_("Refunded submissions keep their number.")
    )
    best = models.ForeignKey(
        "races.Submission", models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("best submission")
    )
    best_session = models.ForeignKey(
        "races.TimedSession",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("best session"),
        help_text=_("In a race of real cars."),
    )
    guest_name = OneLineField(
        _("name of the guest"), max_length=64, blank=True, default="", db_default="", editable=False
    )
    model = models.ForeignKey(
        "evaluation.TrainedModel",
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("model on the real car"),
    )
    classified = models.BooleanField(_("classified"), default=False)
    score_ms = models.PositiveIntegerField(_("score"), null=True, blank=True)
    average_ms = models.PositiveIntegerField(_("average lap"), null=True, blank=True)
    best_lap_ms = models.PositiveIntegerField(_("best lap"), null=True, blank=True)
    total_ms = models.PositiveIntegerField(_("total"), null=True, blank=True)
    complete_laps = models.PositiveSmallIntegerField(_("complete laps"), default=0)
    off_tracks = models.PositiveIntegerField(_("off tracks"), default=0)
    crashes = models.PositiveIntegerField(_("crashes"), default=0)
    resets = models.PositiveIntegerField(_("resets"), default=0)
    sectors = models.JSONField(_("best lap's sectors"), default=list, blank=True)
    achieved_at = models.DateTimeField(_("submitted"), null=True, blank=True)
    rank_score = models.BigIntegerField(_("ranking key 1"), default=NO_RESULT)
    rank_lap = models.PositiveIntegerField(_("ranking key 2"), default=LAST)
    car_of = models.ForeignKey(
        "self",
        models.SET_NULL,
        null=True,
        blank=True,
        editable=False,
        related_name="+",
        verbose_name=_("first entry with this car"),
        help_text=_("No result: this entry submitted the same car first."),
    )

    is_live = models.BooleanField(
        _("driven live"),
        default=False,
        db_default=False,
        editable=False,
        help_text=_("Score from the live event, which ranks ahead of all others."),
    )

    # In a race of duels, from the draw on; the fields above then hold the qualifying.
    seed = models.PositiveSmallIntegerField(
        _("seed"), null=True, blank=True, help_text=_("Qualifying place at the time of the draw.")
    )
    points = models.PositiveSmallIntegerField(_("points"), default=0)
    duels = models.PositiveSmallIntegerField(_("duels"), default=0)
    duel_lap_ms = models.PositiveIntegerField(_("average lap in duels"), null=True, blank=True)

    # The fastest of the racer's classified submissions (of all while none is), for the green marks of a board.
    own_lap_ms = models.PositiveIntegerField(_("personal best lap"), null=True, blank=True)
    own_sector_1_ms = models.PositiveIntegerField(_("personal best sector 1"), null=True, blank=True)
    own_sector_2_ms = models.PositiveIntegerField(_("personal best sector 2"), null=True, blank=True)
    own_sector_3_ms = models.PositiveIntegerField(_("personal best sector 3"), null=True, blank=True)

    day_rank = models.PositiveIntegerField(
        _("rank at the start of the day"),
        null=True,
        blank=True,
        editable=False,
        help_text=_("On the race's day of ranks."),
    )

    class Meta:
        verbose_name = _("entry")
        verbose_name_plural = _("entries")
        constraints = [
            models.UniqueConstraint(fields=["race", "racer"], name="entry_once_in_a_race"),
            models.CheckConstraint(
                condition=Q(classified=False, score_ms__isnull=True, rank_score__gte=NOT_CLASSIFIED - MOST_DRIVEN)
                | Q(classified=True, seed=None, is_live=False, rank_score=F("score_ms"), rank_lap=F("best_lap_ms"))
                | Q(
                    classified=True,
                    seed=None,
                    is_live=True,
                    rank_score=F("score_ms") - LIVE_LEAD,
                    rank_lap=F("best_lap_ms"),
                )
                | Q(
                    classified=True,
                    seed__isnull=False,
                    rank_score=-1 - F("points"),
                    rank_lap=Coalesce("duel_lap_ms", NO_LAP_MS) * SEEDS + F("seed"),
                ),
                name="entry_rank_follows_standing",
            ),
            models.CheckConstraint(
                condition=Q(classified=False, seed=None)
                | Q(classified=True, score_ms__isnull=False, achieved_at__isnull=False),
                name="entry_classified_has_a_score",
            ),
            models.CheckConstraint(
                condition=Q(seed=None, points=0, duels=0, duel_lap_ms=None)
                | Q(seed__gte=1, seed__lt=SEEDS) & (Q(duel_lap_ms=None) | Q(duel_lap_ms__lt=NO_LAP_MS)),
                name="entry_seed_range",
            ),
            models.UniqueConstraint(fields=["race", "seed"], condition=~Q(seed=None), name="entry_seed_once_in_a_race"),
            models.CheckConstraint(
                condition=Q(removed_at__isnull=True) | Q(withdrawn_at__isnull=False), name="entry_removed_is_withdrawn"
            ),
            models.CheckConstraint(
                condition=Q(submission_count__lte=F("last_number")), name="entry_counts_numbered_submissions"
            ),
        ]
        indexes = [
            # the board, and by it every rank: a prefix of this index in order
            models.Index(
                fields=["race", "rank_score", "rank_lap", "resets", "achieved_at", "id", "is_baseline"],
                condition=Q(withdrawn_at=None),
                name="entry_board",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.racer} in {self.race}"

    @property
    def shown_name(self) -> str:
        """The name on the board: the racer's alias, for a guest the typed name."""
        return self.guest_name or self.racer.shown_name

    @property
    def is_withdrawn(self) -> bool:
        return self.withdrawn_at is not None

    @property
    def own_sectors_ms(self) -> tuple[int | None, int | None, int | None]:
        """The racer's own best time in each sector, over the classified submissions (over all while none is)."""
        return self.own_sector_1_ms, self.own_sector_2_ms, self.own_sector_3_ms

    @property
    def rank_key(self) -> tuple:
        """The sort key of the board, smaller first; comparable only between entries with a result."""
        return self.rank_score, self.rank_lap, self.resets, self.achieved_at, self.pk
