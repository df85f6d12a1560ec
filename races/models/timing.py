"""Real cars timed at the track: timekeepers, sessions with their laps, sensors and corrections.

Ids of sessions (one racer's turn on the track) and laps come from the device that measured them, so that a repeated
transfer changes nothing.
"""

import uuid

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from .entry import Entry
from .race import LONGEST_LAP_MS, Race

MOST_LAPS = 500


def new_claim() -> str:
    """A secret that a guest takes their laps over with (24 characters, 142 bits)."""
    return get_random_string(24)


class Source(models.TextChoices):
    HAND = "hand", _("by hand")
    SENSOR = "sensor", _("sensor")
    FILE = "file", _("file")


class LapNote(models.TextChoices):
    NONE = "", _("nothing")
    CLOCK = "clock", _("the clock stood still or jumped")
    RELOADED = "reloaded", _("by the wall clock, because the page was reloaded")


class Timekeeper(models.Model):
    """A timekeeper of a race, appointed by its organiser, without other rights."""

    race = models.ForeignKey(Race, models.CASCADE, related_name="timekeepers", db_index=False)
    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="timed_races")
    named_at = models.DateTimeField(default=timezone.now)

    class Meta:
        verbose_name = _("timekeeper")
        verbose_name_plural = _("timekeepers")
        constraints = [models.UniqueConstraint(fields=["race", "racer"], name="timekeeper_once_in_a_race")]

    def __str__(self) -> str:
        return f"{self.racer} times {self.race}"


class Guest(models.Model):
    """A racer without an account. ``entry``: of the stand-in, or once linked of the racer."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    race = models.ForeignKey(Race, models.CASCADE, related_name="guests")
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="guests")
    name = OneLineField(max_length=64)
    claim = models.CharField(max_length=24, unique=True, default=new_claim, editable=False)
    made_at = models.DateTimeField(default=timezone.now)
    linked_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        verbose_name = _("guest")
        verbose_name_plural = _("guests")

    def __str__(self) -> str:
        return self.name


class TimingSensor(models.Model):
    """A device that reports crossings of the finish line. ``hint``: the token's first characters."""

    race = models.ForeignKey(Race, models.CASCADE, related_name="timing_sensors")
    name = OneLineField(max_length=64)
    token_sha256 = models.CharField(max_length=64, unique=True, editable=False)
    hint = models.CharField(max_length=12, editable=False)
    made_at = models.DateTimeField(default=timezone.now)
    made_by = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, related_name="+")
    revoked_at = models.DateTimeField(null=True, blank=True)
    seen_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        verbose_name = _("timing sensor")
        verbose_name_plural = _("timing sensors")

    def __str__(self) -> str:
        return self.name


class TimedSession(models.Model):
    """One racer's turn on the track. ``revision`` grows with every change made where the times are taken; an older one
    that arrives later changes nothing. ``number``: among the entry's, from 1. ``started_at``: by the server's clock."""

    id = models.UUIDField(primary_key=True, editable=False)
    race = models.ForeignKey(Race, models.CASCADE, related_name="timed_sessions")
    entry = models.ForeignKey(Entry, models.CASCADE, related_name="timed_sessions")
    number = models.PositiveSmallIntegerField()
    revision = models.PositiveIntegerField(default=1)
    source = models.CharField(max_length=6, choices=Source.choices, default=Source.HAND)
    sensor = models.ForeignKey(TimingSensor, models.SET_NULL, null=True, blank=True, related_name="sessions")
    started_at = models.DateTimeField()
    received_at = models.DateTimeField()
    ended_at = models.DateTimeField(null=True, blank=True)
    discarded_at = models.DateTimeField(null=True, blank=True)
    model = models.ForeignKey("evaluation.TrainedModel", models.SET_NULL, null=True, blank=True, related_name="+")
    car = OneLineField(max_length=64, blank=True)
    timekeeper = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+")

    class Meta:
        verbose_name = _("session")
        verbose_name_plural = _("sessions")
        constraints = [
            models.UniqueConstraint(fields=["entry", "number"], name="timedsession_number_once"),
            models.UniqueConstraint(
                fields=["sensor"],
                condition=Q(sensor__isnull=False, ended_at=None, discarded_at=None),
                name="timedsession_one_runs_at_a_sensor",
            ),
            models.CheckConstraint(
                condition=Q(source="sensor") | Q(sensor=None), name="timedsession_sensor_only_where_it_times"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.entry} #{self.number}"


class MeasuredLap(models.Model):
    """One lap that was measured; ``time_ms`` without penalties, which the race's rules add."""

    id = models.UUIDField(primary_key=True, editable=False)
    session = models.ForeignKey(TimedSession, models.CASCADE, related_name="laps", db_index=False)
    number = models.PositiveSmallIntegerField()
    time_ms = models.PositiveIntegerField()
    off_tracks = models.PositiveSmallIntegerField(default=0)
    resets = models.PositiveSmallIntegerField(default=0)
    valid = models.BooleanField(default=True)
    note = models.CharField(max_length=8, choices=LapNote.choices, blank=True)
    corrected = models.BooleanField(default=False)

    class Meta:
        verbose_name = _("lap")
        verbose_name_plural = _("laps")
        constraints = [
            models.UniqueConstraint(fields=["session", "number"], name="measuredlap_number_once"),
            models.CheckConstraint(
                condition=Q(time_ms__gte=1, time_ms__lte=LONGEST_LAP_MS), name="measuredlap_time_range"
            ),
            models.CheckConstraint(condition=Q(number__gte=1, number__lte=MOST_LAPS), name="measuredlap_number_range"),
        ]

    def __str__(self) -> str:
        return f"{self.session}, {self.number}: {self.time_ms} ms"


class LapCorrection(models.Model):
    """A later correction of a lap, with its reason. ``before``, ``after``: time_ms, off_tracks, resets, valid."""

    lap = models.ForeignKey(MeasuredLap, models.CASCADE, related_name="corrections")
    by = models.ForeignKey(settings.AUTH_USER_MODEL, models.SET_NULL, null=True, related_name="+")
    at = models.DateTimeField()
    reason = OneLineField(max_length=255)
    before = models.JSONField()
    after = models.JSONField()

    class Meta:
        verbose_name = _("correction")
        verbose_name_plural = _("corrections")
        constraints = [
            models.CheckConstraint(condition=~Q(reason=""), name="lapcorrection_has_a_reason"),
        ]

    def __str__(self) -> str:
        return f"{self.lap}: {self.reason}"


class CrossingVerdict(models.TextChoices):
    START = "start", _("begins a lap")
    LAP = "lap", _("ends a lap")
    BOUNCE = "bounce", _("repeats the previous crossing")


class Crossing(models.Model):
    """A crossing of the finish line that a session accepted. ``boot``: the sensor's start from which ``number`` and
    ``at_ms`` count. ``at_ms`` is None without a clock: the time of receipt counts."""

    session = models.ForeignKey(TimedSession, models.CASCADE, related_name="crossings")
    sensor = models.ForeignKey(TimingSensor, models.CASCADE, related_name="crossings", db_index=False)
    boot = models.CharField(max_length=32, blank=True)
    number = models.PositiveBigIntegerField()
    at_ms = models.PositiveBigIntegerField(null=True)
    received_at = models.DateTimeField()
    verdict = models.CharField(max_length=6, choices=CrossingVerdict.choices)
    lap = models.OneToOneField(MeasuredLap, models.SET_NULL, null=True, related_name="crossing")

    class Meta:
        verbose_name = _("crossing")
        verbose_name_plural = _("crossings")
        constraints = [models.UniqueConstraint(fields=["sensor", "boot", "number"], name="crossing_once")]

    def __str__(self) -> str:
        return f"{self.sensor} {self.number}: {self.verdict}"
