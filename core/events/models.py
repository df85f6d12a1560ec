"""The tables of events and of the readers' cursors."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.db.models.functions import Now
from django.utils.translation import gettext_lazy as _


class Event(models.Model):
    """One thing that happened at ``at``; ``recorded_at``: when it was written.

    ``race``: an id; ``subject``: a public id or address; ``once``: the key of a kind that happens once. ``position``:
    its place in the readers' order, None until a reader numbers it (:mod:`core.events.reading`)."""

    position = models.PositiveBigIntegerField(_("position"), null=True, unique=True, editable=False)
    kind = models.CharField(_("kind"), max_length=32)
    at = models.DateTimeField(_("time"))
    recorded_at = models.DateTimeField(_("recorded"), db_default=Now(), db_index=True, editable=False)
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.CASCADE,
        null=True,
        blank=True,
        related_name="+",
        db_index=False,
        verbose_name=_("racer"),
    )
    race = models.PositiveBigIntegerField(_("race"), null=True, blank=True)
    subject = models.CharField(_("subject"), max_length=64, blank=True)
    data = models.JSONField(_("data"), default=dict, blank=True)
    once = models.CharField(_("deduplication key"), max_length=160, null=True, blank=True, editable=False)

    class Meta:
        verbose_name = _("event")
        verbose_name_plural = _("events")
        ordering = ["position", "pk"]
        indexes = [
            models.Index(fields=["id"], condition=Q(position=None), name="event_without_position"),
            models.Index(fields=["racer", "position"], name="event_by_racer"),
            models.Index(fields=["race", "position"], name="event_by_race"),
        ]
        constraints = [
            models.UniqueConstraint(fields=["kind", "once"], name="event_once"),
            models.CheckConstraint(condition=~Q(kind=""), name="event_has_a_kind"),
        ]

    def __str__(self) -> str:
        return f"{self.kind} {self.subject}".strip()


class EventCursor(models.Model):
    """How far a reader has come. The row ``NUMBERED`` holds the last position given."""

    NUMBERED = "numbered"

    reader = models.CharField(_("reader"), max_length=32, primary_key=True)
    position = models.PositiveBigIntegerField(_("position"), default=0)

    class Meta:
        verbose_name = _("reader of events")
        verbose_name_plural = _("readers of events")

    def __str__(self) -> str:
        return f"{self.reader}: {self.position}"
