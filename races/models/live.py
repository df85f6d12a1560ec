"""A race's live event: times, format, racers, running order and the log of its organisers' actions."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from .entry import Entry
from .race import Race

if TYPE_CHECKING:
    from evaluation.models import Evaluation

LOBBY = timedelta(hours=1)
COUNTDOWN = timedelta(seconds=10)
# Pages play so much behind the clock, so that all of them have what they play; results come after the last of them.
PLAYED_BEHIND = timedelta(milliseconds=1500)
REVEALED_AFTER = timedelta(seconds=2)
UNDO_FOR = timedelta(minutes=2)
INTERRUPTED_AFTER = timedelta(seconds=6)  # so much of a run that nobody could see interrupts it
HEAT_CARS = "duel__cars__entry__racer"  # what LiveSlot.entries reads of a heat
MOST_ROUNDS = 5
LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS = 10_000, 600_000


class LiveState(models.TextChoices):
    """The states of a live event. ENDED and CANCELLED are final."""

    PLANNED = "planned", _("planned")
    RUNNING = "running", _("running")
    PAUSED = "paused", _("paused")
    ENDED = "ended", _("ended")
    CANCELLED = "cancelled", _("cancelled")


OVER = (LiveState.ENDED, LiveState.CANCELLED)
UNDER_WAY = (LiveState.RUNNING, LiveState.PAUSED)


class LiveOrder(models.TextChoices):
    SLOWEST_FIRST = "slowest_first", _("slowest first")
    FASTEST_FIRST = "fastest_first", _("fastest first")
    AS_ENTERED = "as_entered", _("in entry order")


class LiveEvent(models.Model):
    """A race's live event: its racers drive one after the other, and everybody watches each run at the same instant.

    ``version`` counts the organisers' actions: each action names the version it was based on, so two organisers do one
    thing once. The time alone opens the lobby (:meth:`in_lobby`). ``last_at``: time of the last action
    or run; an idle event ends by itself. ``clock_at``: when the clock last saw the present run on track. ``start_m``,
    ``seed``: of its runs (:mod:`races.rules.live_start`); None in older events: the race's. ``attempt_ms``: simulated
    time, shown in real time.
    """

    race = models.OneToOneField(Race, models.CASCADE, related_name="live_event")
    starts_at = models.DateTimeField()
    time_zone = models.CharField(max_length=64, default="UTC")
    lobby_opens_at = models.DateTimeField()
    submissions_open = models.BooleanField(default=True)
    roll_call = models.BooleanField(
        _("roll call"), default=False, help_text=_("Racers who have not checked in are held.")
    )
    rounds = models.PositiveSmallIntegerField(
        default=2, validators=[MinValueValidator(1), MaxValueValidator(MOST_ROUNDS)]
    )
    attempt_ms = models.PositiveIntegerField(
        default=180_000, validators=[MinValueValidator(LEAST_ATTEMPT_MS), MaxValueValidator(MOST_ATTEMPT_MS)]
    )
    start_m = models.FloatField(null=True, blank=True)
    seed = models.PositiveIntegerField(null=True, blank=True)
    order = models.CharField(_("order"), max_length=16, choices=LiveOrder.choices, default=LiveOrder.SLOWEST_FIRST)
    auto_run = models.BooleanField(
        _("automatic"), default=False, help_text=_("The event starts on time and runs automatically.")
    )
    gap_s = models.PositiveSmallIntegerField(default=20, validators=[MaxValueValidator(600)])
    speed_control = models.BooleanField(
        _("racers set their car's speed"),
        default=False,
        db_default=False,
        help_text=_("Before a run and while it is shown. Speed commands count in the result."),
    )

    state = models.CharField(max_length=9, choices=LiveState.choices, default=LiveState.PLANNED)
    version = models.PositiveIntegerField(default=1)
    message = OneLineField(max_length=200, blank=True, default="")
    winner = models.ForeignKey(Entry, models.SET_NULL, null=True, blank=True, related_name="+")
    podium_at = models.DateTimeField(null=True, blank=True)
    begun_at = models.DateTimeField(null=True, blank=True)
    ended_at = models.DateTimeField(null=True, blank=True)
    last_at = models.DateTimeField(default=timezone.now)
    clock_at = models.DateTimeField(null=True, blank=True, editable=False)
    planned_by = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+")

    class Meta:
        verbose_name = _("live event")
        verbose_name_plural = _("live events")
        ordering = ["-starts_at", "pk"]
        indexes = [
            models.Index(
                fields=["starts_at"],
                condition=Q(state__in=["planned", "running", "paused"]),
                name="live_event_not_over",
            )
        ]
        constraints = [
            models.CheckConstraint(condition=Q(state__in=LiveState.values), name="live_event_state_known"),
            models.CheckConstraint(condition=Q(order__in=LiveOrder.values), name="live_event_order_known"),
            models.CheckConstraint(condition=Q(lobby_opens_at__lte=F("starts_at")), name="live_event_lobby_first"),
            models.CheckConstraint(condition=Q(rounds__gte=1, rounds__lte=MOST_ROUNDS), name="live_event_rounds_range"),
            models.CheckConstraint(
                condition=Q(attempt_ms__gte=LEAST_ATTEMPT_MS, attempt_ms__lte=MOST_ATTEMPT_MS),
                name="live_event_attempt_range",
            ),
            models.CheckConstraint(condition=Q(start_m=None) | Q(start_m__gte=0), name="live_event_start_range"),
            models.CheckConstraint(
                condition=Q(state__in=["planned", "cancelled"]) | Q(begun_at__isnull=False),
                name="live_event_under_way_has_begun",
            ),
            models.CheckConstraint(
                condition=~Q(state="ended") | Q(ended_at__isnull=False), name="live_event_ended_has_time"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.race}: {self.starts_at:%Y-%m-%d %H:%M}"

    @property
    def is_over(self) -> bool:
        return self.state in OVER

    def in_lobby(self, now: datetime) -> bool:
        return self.state == LiveState.PLANNED and now >= self.lobby_opens_at


class LiveRacer(models.Model):
    """A racer of the race in its live event: the model they drive and their roll call.

    ``model``: None until they choose one; then they drive what their result in the race came from.
    ``qualified_rank``, ``qualified_ms``: place and score in the race when the event began.
    ``deputy``: another racer with command of the car's speed. ``speed``: the start setting of their runs,
    ``{"mode", "value", "by"}``; None: the model's own speed. ``speed_at``: time of the last accepted command.
    """

    # no separate index: the unique one over event and entry begins with it
    event = models.ForeignKey(LiveEvent, models.CASCADE, related_name="racers", db_index=False)
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="live_racers")
    model = models.ForeignKey("evaluation.TrainedModel", models.SET_NULL, null=True, blank=True, related_name="+")
    here_at = models.DateTimeField(null=True, blank=True)
    qualified_rank = models.PositiveIntegerField(null=True, blank=True)
    qualified_ms = models.PositiveBigIntegerField(null=True, blank=True)
    deputy = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+")
    speed: models.JSONField[Any, Any] = models.JSONField(null=True, blank=True)
    speed_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        verbose_name = _("racer of a live event")
        verbose_name_plural = _("racers of a live event")
        constraints = [models.UniqueConstraint(fields=["event", "entry"], name="live_racer_once_in_an_event")]

    def __str__(self) -> str:
        return f"{self.entry}"


class SlotState(models.TextChoices):
    """The states of a place in the running order. A RUNNING slot counts down and then drives: the time decides."""

    WAITING = "waiting", _("waiting")
    CALLED = "called", _("called")
    RUNNING = "running", _("on track")
    DONE = "done", _("done")
    SKIPPED = "skipped", _("skipped")
    HELD = "held", _("held")
    REMOVED = "removed", _("removed")


TO_COME = (SlotState.WAITING, SlotState.CALLED)


class SlotPhase(models.TextChoices):
    COUNTDOWN = "countdown", _("starts at once")
    ON_TRACK = "on_track", _("on track")


class LiveSlot(models.Model):
    """A place in the running order: an attempt of a racer, or a heat of duels.

    ``evaluation``: its run, sealed until it has been shown. ``starts_at``: when it starts for everybody, by the
    server's clock. ``ends_at``: when its last step has been played; it tells how long the car drove, so it stays here
    until then. ``submission``: the run as a result of the race, from then on. ``interrupted_at``: when the site was
    away while the run was shown, so that the same run is shown again.
    ``speed_log``: the commands that ``evaluation`` was driven with, each ``{"at_ms", "mode", "value", "by"}`` and of a
    heat the number of the ``"car"``. ``speed_next``: one that is being computed, in ``speed_run``, the same run with
    one command more; ``speed_wish``: what is commanded after it; ``speed_reason``: why the last one expired.
    """

    event = models.ForeignKey(LiveEvent, models.CASCADE, related_name="slots")
    racer = models.ForeignKey(LiveRacer, models.CASCADE, null=True, blank=True, related_name="slots")
    duel = models.ForeignKey("races.Duel", models.CASCADE, null=True, blank=True, related_name="live_slots")
    round = models.PositiveSmallIntegerField()
    attempt = models.PositiveSmallIntegerField(default=1)
    position = models.PositiveIntegerField()
    state = models.CharField(max_length=7, choices=SlotState.choices, default=SlotState.WAITING)
    evaluation = models.OneToOneField(
        "evaluation.Evaluation", models.PROTECT, null=True, blank=True, related_name="live_slot"
    )
    starts_at = models.DateTimeField(null=True, blank=True)
    ends_at = models.DateTimeField(null=True, blank=True)
    done_at = models.DateTimeField(null=True, blank=True)
    interrupted_at = models.DateTimeField(null=True, blank=True, editable=False)
    submission = models.OneToOneField(
        "races.Submission", models.SET_NULL, null=True, blank=True, related_name="live_slot"
    )
    reason_code = models.CharField(max_length=40, blank=True, default="")
    speed_log: models.JSONField[Any, Any] = models.JSONField(null=True, blank=True)
    speed_next: models.JSONField[Any, Any] = models.JSONField(null=True, blank=True)
    speed_wish: models.JSONField[Any, Any] = models.JSONField(null=True, blank=True)
    speed_reason = models.CharField(max_length=40, null=True, blank=True)
    speed_run = models.OneToOneField("evaluation.Evaluation", models.PROTECT, null=True, blank=True, related_name="+")

    class Meta:
        verbose_name = _("place in the running order")
        verbose_name_plural = _("running order")
        ordering = ["event", "position", "pk"]
        constraints = [
            models.CheckConstraint(condition=Q(state__in=SlotState.values), name="live_slot_state_known"),
            models.CheckConstraint(
                condition=Q(racer__isnull=False, duel=None) | Q(racer=None, duel__isnull=False),
                name="live_slot_of_a_racer_or_a_duel",
            ),
            # two launches at once: one of them
            models.UniqueConstraint(fields=["event"], condition=Q(state="running"), name="live_slot_one_on_track"),
            models.UniqueConstraint(
                fields=["racer", "round", "attempt"], condition=Q(duel=None), name="live_slot_attempt_once"
            ),
            models.CheckConstraint(
                condition=~Q(state="running")
                | Q(starts_at__isnull=False, ends_at__isnull=False, evaluation__isnull=False),
                name="live_slot_runs_an_evaluation",
            ),
            models.CheckConstraint(
                condition=Q(ends_at=None) | Q(ends_at__gte=F("starts_at")), name="live_slot_ends_after_start"
            ),
            models.CheckConstraint(
                condition=~Q(state="done") | Q(done_at__isnull=False), name="live_slot_done_has_time"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.event} {self.position}"

    @property
    def entries(self) -> list[Entry]:
        """The drivers: a racer alone, or those of a heat, the front car (number 0 of its run) first."""
        if self.racer is not None:
            return [self.racer.entry]
        return [] if self.duel is None else [car.entry for car in self.duel.cars.all()]

    @property
    def starting(self) -> list[Entry]:
        """The drivers in the run: without those that had left the race when the heat was computed."""
        if self.duel is None:
            return self.entries
        return [car.entry for car in self.duel.cars.all() if not car.forfeited]

    @property
    def driver_names(self) -> str:
        return " – ".join(entry.racer.alias for entry in self.entries)

    @property
    def shown_run(self) -> Evaluation | None:
        """The run of a slot that was shown; None before, and for a walkover."""
        if self.state != SlotState.DONE:
            return None
        if self.duel is not None:
            return self.duel.evaluation
        return None if self.submission is None else self.submission.evaluation

    def phase_at(self, now: datetime) -> str:
        """The visible phase: countdown or on track for a running slot, else its state."""
        if self.state != SlotState.RUNNING or self.starts_at is None:
            return self.state
        return SlotPhase.COUNTDOWN if now < self.starts_at else SlotPhase.ON_TRACK


class LiveLog(models.Model):
    """An action in a live event. ``by``: None for the clock. ``undo``: values before and after; None for final ones."""

    event = models.ForeignKey(LiveEvent, models.CASCADE, related_name="log")
    at = models.DateTimeField()
    by = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+")
    action = models.CharField(max_length=16)
    told: models.JSONField[Any, Any] = models.JSONField(default=dict, blank=True)
    undo: models.JSONField[Any, Any] = models.JSONField(null=True, blank=True)
    undone_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        verbose_name = _("entry in the log of a live event")
        verbose_name_plural = _("log of a live event")
        ordering = ["event", "-pk"]

    def __str__(self) -> str:
        return f"{self.event} {self.action}"


class ReactionKind(models.TextChoices):
    CLAP = "clap", _("applause")
    FIRE = "fire", _("fast")
    WOW = "wow", _("astonished")
    LAUGH = "laugh", _("funny")
    HEART = "heart", _("love it")
    FLAG = "flag", _("finish")


class LiveReaction(models.Model):
    """The count of a reaction; its senders are not stored."""

    # no separate index: the unique one over event and kind begins with it
    event = models.ForeignKey(LiveEvent, models.CASCADE, related_name="reactions", db_index=False)
    kind = models.CharField(max_length=8, choices=ReactionKind.choices)
    count = models.PositiveBigIntegerField(default=0)

    class Meta:
        verbose_name = _("reaction to a live event")
        verbose_name_plural = _("reactions to live events")
        constraints = [
            models.UniqueConstraint(fields=["event", "kind"], name="live_reaction_once_a_kind"),
            models.CheckConstraint(condition=Q(kind__in=ReactionKind.values), name="live_reaction_kind_known"),
        ]

    def __str__(self) -> str:
        return f"{self.event} {self.kind}: {self.count}"
