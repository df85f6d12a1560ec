"""Marks of students, and their regrades."""

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField

from .assignment import Assignment
from .attempt import Attempt


class Mark(models.Model):
    """The mark of a student in an assignment; members of a submission group have equal ones.

    ``parts``: a list of :class:`courses.marking.facts.PartMarkDocument`. ``is_complete``: no run waits and no hidden
    track is to come. ``rules_version``: by which rules."""

    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="marks", verbose_name=_("assignment"))
    racer = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="marks", verbose_name=_("racer"))
    attempt = models.ForeignKey(
        Attempt, models.SET_NULL, null=True, blank=True, related_name="marks", verbose_name=_("attempt that counts")
    )
    points = models.DecimalField(_("points"), max_digits=8, decimal_places=2, default=0)
    before_late = models.DecimalField(_("points before lateness"), max_digits=8, decimal_places=2, default=0)
    late_days = models.PositiveIntegerField(_("late days"), default=0)
    parts = models.JSONField(_("parts"), default=list, blank=True)
    is_complete = models.BooleanField(_("complete"), default=False)
    rules_version = models.PositiveIntegerField(_("version of the rules"), default=1)
    computed_at = models.DateTimeField(_("computed"))

    class Meta:
        verbose_name = _("mark")
        verbose_name_plural = _("marks")
        ordering = ["assignment", "-points", "pk"]
        constraints = [models.UniqueConstraint(fields=["assignment", "racer"], name="mark_once")]

    def __str__(self) -> str:
        return f"{self.assignment_id}: {self.racer_id}"


class Regrade(models.Model):
    """Marks by changed rules, beside those that stand. ``rows``: a list of ``{racer, old, new}`` with points as text,
    only of students whose mark differs; nothing changes before it is applied."""

    assignment = models.ForeignKey(Assignment, models.CASCADE, related_name="regrades", verbose_name=_("assignment"))
    reason = OneLineField(_("reason"), max_length=200)
    rules_version = models.PositiveIntegerField(_("version of the rules"))
    asked_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("by")
    )
    asked_at = models.DateTimeField(_("proposed"))
    applied_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.SET_NULL, null=True, blank=True, related_name="+", verbose_name=_("applied by")
    )
    applied_at = models.DateTimeField(_("applied"), null=True, blank=True)
    rows = models.JSONField(_("marks"), default=list, blank=True)

    class Meta:
        verbose_name = _("regrade")
        verbose_name_plural = _("regrades")
        ordering = ["-asked_at", "-pk"]

    def __str__(self) -> str:
        return f"{self.assignment_id}: {self.rules_version}"
