"""The catalogue of tracks in the database."""

from django.conf import settings
from django.db import models
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from core.database.columns import MultiLineField, OneLineField
from core.jobs.models import Job, lease_constraints
from paddock.errors import UserFault
from paddock.geometry.files import read_npy
from paddock.geometry.track import TrackGeometry


class Direction(models.TextChoices):
    CCW = "ccw", _("counter-clockwise")
    CW = "cw", _("clockwise")


class TrackLook(models.TextChoices):
    """How a track looks to cameras: the names of the themes in paddock.simulator.camera.theme."""

    OFFICIAL = "official", _("as in the official simulator")
    TEXTURES = "textures", _("the official textures in full light")
    BOLD = "bold", _("large dashes, a far and high wall")


class Track(models.Model):
    """A track that races can be held on. Its geometry and its look never change: another shape is another track.

    One of an imported season may have only a name (:attr:`has_shape`); no new race is held on it.
    """

    slug = models.SlugField(_("address"), unique=True, max_length=64)
    name = OneLineField(_("name"), max_length=64)
    description = MultiLineField(_("description"), blank=True, max_length=1000)
    npy = models.BinaryField(_("geometry"), editable=False)
    fingerprint = models.CharField(_("fingerprint"), max_length=64, unique=True, editable=False)
    length_m = models.FloatField(_("length in metres"), null=True, blank=True, editable=False)
    width_m = models.FloatField(_("width in metres"), null=True, blank=True, editable=False)
    corners = models.PositiveSmallIntegerField(_("corners"), null=True, blank=True, editable=False)
    difficulty = models.PositiveSmallIntegerField(_("difficulty"), null=True, blank=True, editable=False)
    direction = models.CharField(_("the file's own direction"), max_length=3, choices=Direction.choices, editable=False)
    is_open = models.BooleanField(
        _("driven from start to end"), default=False, db_default=models.Value(False), editable=False
    )
    look = models.CharField(
        _("look"), max_length=16, choices=TrackLook.choices, default=TrackLook.OFFICIAL, editable=False
    )
    is_catalogue = models.BooleanField(_("from the catalogue"), default=False, editable=False)
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="tracks",
        verbose_name=_("imported by"),
    )
    created_at = models.DateTimeField(_("added"), default=timezone.now, editable=False)

    class Meta:
        verbose_name = _("track")
        verbose_name_plural = _("tracks")
        ordering = ["-is_catalogue", "length_m"]
        constraints = [
            models.CheckConstraint(condition=models.Q(length_m__gt=0), name="track_length_positive"),
            models.CheckConstraint(condition=models.Q(width_m__gt=0), name="track_width_positive"),
            models.CheckConstraint(
                condition=models.Q(
                    length_m__isnull=True,
                    width_m__isnull=True,
                    corners__isnull=True,
                    difficulty__isnull=True,
                    is_catalogue=False,
                )
                | models.Q(
                    length_m__isnull=False, width_m__isnull=False, corners__isnull=False, difficulty__isnull=False
                ),
                name="track_has_all_measures_or_no_shape",
            ),
            models.CheckConstraint(condition=models.Q(difficulty__lte=100), name="track_difficulty_at_most_100"),
            models.CheckConstraint(condition=models.Q(direction__in=Direction.values), name="track_direction_known"),
            models.CheckConstraint(condition=models.Q(look__in=TrackLook.values), name="track_look_known"),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("track", args=[self.slug])

    @property
    def has_shape(self) -> bool:
        """Whether the track's geometry is known here, so that it can be drawn and driven on."""
        return self.length_m is not None

    @property
    def geometry(self) -> TrackGeometry:
        """The geometry in the file's direction, cached for each process. Raises UserFault("track_shape_unknown")."""
        if not self.has_shape:
            raise UserFault("track_shape_unknown", name=self.name)
        found = _geometries.get(key := (self.fingerprint, self.slug))
        if found is None:  # only then are the points read, which lists of tracks defer
            found = _geometries[key] = read_npy(bytes(self.npy), self.slug, is_open=None, is_known=True)
            for oldest in list(_geometries)[:-_MOST_GEOMETRIES]:
                _geometries.pop(oldest, None)
        return found

    def way(self, direction: str) -> str:
        """A direction in words: an open track is driven as it is drawn or back."""
        if not self.is_open:
            return str(Direction(direction).label)
        return gettext("from start to end") if direction == self.direction else gettext("from end to start")


_MOST_GEOMETRIES = 128
_geometries: dict[tuple[str, str], TrackGeometry] = {}


class ReferenceState(models.TextChoices):
    """FAILED: no lap could be driven on the track."""

    QUEUED = "queued", _("queued")
    RUNNING = "running", _("on track")
    FINISHED = "finished", _("finished")
    FAILED = "failed", _("failed")


class ReferenceLap(Job):
    """The reference of a track in one direction on one engine: a run of :mod:`paddock.analysis.reference_lap`.

    ``laps``: LapResult dicts in order; ``time_ms``: the best lap; ``trace``: its sim-trace, a gzipped CSV file.
    """

    track = models.ForeignKey(
        Track, models.CASCADE, related_name="reference_laps", verbose_name=_("track"), db_index=False
    )
    direction = models.CharField(_("direction"), max_length=3, choices=Direction.choices)
    engine = models.CharField(_("engine"), max_length=32)
    state = models.CharField(_("state"), max_length=8, choices=ReferenceState.choices, default=ReferenceState.QUEUED)
    queued_at = models.DateTimeField(_("queued"), default=timezone.now)
    time_ms = models.PositiveIntegerField(_("best lap"), null=True, blank=True)
    laps = models.JSONField(_("laps"), default=list, blank=True)
    trace = models.BinaryField(_("trace"), default=b"", editable=False)
    trace_sha256 = models.CharField(_("sha-256 of the trace"), max_length=64, blank=True)

    class Meta:
        verbose_name = _("reference lap")
        verbose_name_plural = _("reference laps")
        ordering = ["queued_at", "pk"]
        constraints = [
            *lease_constraints("reference", waiting="queued", working="running", final=["finished", "failed"]),
            models.UniqueConstraint(fields=["track", "direction", "engine"], name="reference_driven_once"),
            models.CheckConstraint(
                condition=models.Q(direction__in=Direction.values), name="reference_direction_known"
            ),
            models.CheckConstraint(
                condition=models.Q(state="finished", time_ms__gt=0) & ~models.Q(trace_sha256="")
                | ~models.Q(state="finished") & models.Q(time_ms=None, trace_sha256=""),
                name="reference_finished_has_a_time",
            ),
            models.CheckConstraint(
                condition=~models.Q(state="failed") | ~models.Q(reason_code=""), name="reference_failure_has_reason"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.track_id} {self.direction}"
