"""Videos of finished runs. The table is their queue."""

from __future__ import annotations

from typing import Any

from django.conf import settings
from django.db import models
from django.db.models import F, Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.utils.translation import pgettext_lazy

from core.ids import new_public_id
from core.jobs.models import Job, lease_constraints
from evaluation.models import SHA256
from paddock.rules.race import MAX_CARS

WHOLE = 0  # the part of the whole run
CLIPS = 20_000  # the first part that is a clip; more than any run has laps
REEL = 32_000  # the part of a reel; more than any run has laps


class VideoState(models.TextChoices):
    """The states of a video. READY and FAILED are final until the next request."""

    WAITING = "waiting", _("waiting")
    DRAWING = "drawing", _("rendering")
    READY = "ready", _("ready")
    FAILED = "failed", _("failed")


class VideoCamera(models.TextChoices):
    """From where a video shows the run: from above, or in perspective (``videos.drawing.lens``)."""

    FOLLOW = "follow", pgettext_lazy("camera", "From above")
    CHASE = "chase", pgettext_lazy("camera", "Chase")
    ONBOARD = "onboard", pgettext_lazy("camera", "Onboard")
    TRACKSIDE = "trackside", pgettext_lazy("camera", "Trackside")
    TOP = "top", _("Whole track")


class VideoFormat(models.TextChoices):
    MP4 = "mp4", "MP4"
    WEBP = "webp", "WebP"


CONTENT_TYPES = {VideoFormat.MP4: "video/mp4", VideoFormat.WEBP: "image/webp"}
UNDER_WAY = (VideoState.WAITING, VideoState.DRAWING)


class Video(Job):
    """One video of a finished run: of the whole run or one lap, following one car, with words in one language.

    ``car``: the number of the car that is followed, 0 for the evaluation's own. ``part``: 0 for the whole run, a lap of
    that car, from :data:`CLIPS` on a clip of the run between ``from_ms`` and ``to_ms``, or :data:`REEL`: the moments in
    ``segments`` (:class:`.scenes.Segment`), whose first run is ``evaluation``. ``fingerprint``:
    :meth:`.scenes.VideoRun.fingerprint` of the file. ``asks``: requests by
    ``asked_by`` on the day of ``asked_at``.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    evaluation = models.ForeignKey(
        "evaluation.Evaluation", models.CASCADE, related_name="videos", verbose_name=_("evaluation"), db_index=False
    )
    car = models.PositiveSmallIntegerField(_("car followed"), default=0)
    part = models.PositiveSmallIntegerField(_("part"), default=WHOLE, help_text=_("0: the whole run, else a lap."))
    language = models.CharField(_("language"), max_length=8)
    segments: models.JSONField[Any, Any] = models.JSONField(_("moments"), null=True, blank=True)
    from_ms = models.PositiveIntegerField(_("from"), default=0, db_default=0, help_text=_("Simulated milliseconds."))
    to_ms = models.PositiveIntegerField(_("to"), default=0, db_default=0, help_text=_("0: no clip."))
    camera = models.CharField(
        _("camera"), max_length=9, choices=VideoCamera.choices, default="follow", db_default="follow"
    )
    format = models.CharField(_("format"), max_length=4, choices=VideoFormat.choices, default="mp4", db_default="mp4")

    state = models.CharField(_("state"), max_length=8, choices=VideoState.choices, default=VideoState.WAITING)
    progress = models.PositiveSmallIntegerField(_("progress"), default=0, help_text=_("Per cent."))
    asked_by = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="+",
        verbose_name=_("requested by"),
    )
    asked_at = models.DateTimeField(_("requested at"), default=timezone.now)
    asks = models.PositiveSmallIntegerField(_("number of requests"), default=1)
    watched_at = models.DateTimeField(_("last watched"), null=True, blank=True)

    fingerprint = models.CharField(_("fingerprint"), max_length=64, blank=True)
    file = models.FileField(_("file"), upload_to="videos/", blank=True)
    poster = models.FileField(_("still"), upload_to="videos/", blank=True)
    sha256 = models.CharField(_("sha-256 of the file"), max_length=64, blank=True)
    size = models.PositiveBigIntegerField(_("bytes"), default=0)
    duration_ms = models.PositiveIntegerField(_("length"), default=0)
    width = models.PositiveSmallIntegerField(_("width"), default=0)
    height = models.PositiveSmallIntegerField(_("height"), default=0)

    class Meta:
        verbose_name = _("video")
        verbose_name_plural = _("videos")
        ordering = ["-asked_at", "-pk"]
        indexes = [
            models.Index(fields=["asked_at", "id"], condition=Q(state="waiting"), name="video_queue"),
            models.Index(fields=["leased_until"], condition=Q(state="drawing"), name="video_leases"),
            models.Index(fields=["watched_at"], condition=Q(state="ready"), name="video_by_watching"),
            models.Index(fields=["asked_by", "-asked_at"], name="video_of_racer"),
        ]
        constraints = [
            *lease_constraints("video", waiting="waiting", working="drawing", final=["ready", "failed"]),
            models.UniqueConstraint(fields=["evaluation", "car", "part", "language"], name="video_made_once"),
            models.CheckConstraint(
                condition=Q(from_ms=0, to_ms=0) & ~Q(part__gte=CLIPS, part__lt=REEL)
                | Q(part__gte=CLIPS, part__lt=REEL, to_ms__gt=F("from_ms")),
                name="video_clip_has_a_moment",
            ),
            models.CheckConstraint(condition=Q(camera__in=VideoCamera.values), name="video_camera_known"),
            models.CheckConstraint(condition=Q(format__in=VideoFormat.values), name="video_format_known"),
            models.CheckConstraint(condition=Q(car__lt=MAX_CARS), name="video_car_in_range"),
            models.CheckConstraint(condition=Q(progress__lte=100), name="video_progress_in_range"),
            models.CheckConstraint(condition=~Q(language=""), name="video_has_language"),
            models.CheckConstraint(
                condition=Q(part=REEL, segments__isnull=False) | Q(part__lt=REEL, segments=None),
                name="video_reel_has_moments",
            ),
            models.CheckConstraint(
                condition=Q(state="failed") & ~Q(reason_code="") | ~Q(state="failed") & Q(reason_code=""),
                name="video_failed_for_a_reason",
            ),
            models.CheckConstraint(
                condition=~Q(state="ready") & Q(file="", poster="", sha256="", size=0, duration_ms=0, watched_at=None)
                | ~(Q(file="") | Q(poster=""))
                & Q(
                    state="ready",
                    sha256__regex=SHA256,
                    fingerprint__regex=SHA256,
                    size__gt=0,
                    duration_ms__gt=0,
                    watched_at__isnull=False,
                ),
                name="video_ready_has_a_file",
            ),
        ]

    def __str__(self) -> str:
        return self.public_id

    def get_absolute_url(self) -> str:
        return f"{reverse('evaluation', args=[self.evaluation.public_id])}?video={self.public_id}#video"

    @property
    def is_under_way(self) -> bool:
        return self.state in UNDER_WAY
