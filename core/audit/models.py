"""The table of the audit log. Triggers of the database refuse changes and deletions (:mod:`.triggers`)."""

from typing import Any

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.db.models.functions import Now
from django.utils.translation import gettext_lazy as _

from .acting import ADMIN, API, COMMAND, PAGE


class AuditChannel(models.TextChoices):
    PAGE = PAGE, _("page")
    API = API, _("API")
    ADMIN = ADMIN, _("admin site")
    COMMAND = COMMAND, _("command")


def _person(name: Any) -> models.ForeignKey:
    """A racer's id that stays when the racer is deleted, and then names nobody."""
    return models.ForeignKey(
        settings.AUTH_USER_MODEL,
        models.DO_NOTHING,
        null=True,
        db_constraint=False,
        db_index=False,
        related_name="+",
        verbose_name=name,
    )


class AuditEntry(models.Model):
    """One act. ``racer``: whom it concerns; ``race``: an id; ``target_name``: of things, never of persons.

    ``changes``: by field, the value before and after; None where the values are secret or personal."""

    at = models.DateTimeField(_("time"), db_default=Now(), db_index=True, editable=False)
    action = models.CharField(_("action"), max_length=48)
    actor = _person(_("actor"))
    channel = models.CharField(_("channel"), max_length=8, choices=AuditChannel.choices)
    program = models.CharField(_("command or token"), max_length=64, blank=True)
    target_kind = models.CharField(_("kind of target"), max_length=64)
    target_id = models.CharField(_("id of target"), max_length=64, blank=True)
    target_name = models.CharField(_("target"), max_length=100, blank=True)
    racer = _person(_("racer"))
    race = models.PositiveBigIntegerField(_("race"), null=True, blank=True)
    changes = models.JSONField(_("changes"), default=dict, blank=True)
    request = models.CharField(_("request id"), max_length=64, blank=True)
    network = models.CharField(_("network"), max_length=43, blank=True)

    class Meta:
        verbose_name = _("audit entry")
        verbose_name_plural = _("audit log")
        ordering = ["-pk"]
        default_permissions = ("view",)
        indexes = [
            models.Index(fields=["actor", "-id"], name="audit_by_actor"),
            models.Index(fields=["action", "-id"], name="audit_by_action"),
            models.Index(fields=["race", "-id"], name="audit_by_race"),
            models.Index(fields=["target_kind", "target_id", "-id"], name="audit_by_target"),
            models.Index(fields=["target_name", "-id"], name="audit_by_name"),
        ]
        constraints = [models.CheckConstraint(condition=~Q(action=""), name="audit_entry_has_an_action")]

    def __str__(self) -> str:
        return f"{self.action} {self.target_name or self.target_id}".strip()
