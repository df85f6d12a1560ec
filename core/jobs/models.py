"""Columns and constraints of all jobs, and the table of outages."""

from collections.abc import Sequence

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext as translated
from django.utils.translation import gettext_lazy as _

from paddock.errors.reasons import REASONS

from ..logs.lines import current_request


def reason_sentence(code: str, params: dict) -> str:
    """A reason in the reader's language; ``""`` where there is none. ``params``: what its sentence names."""
    if not code:
        return ""
    reason = REASONS[code]
    return reason.render(params, translated(reason.sentence))


class Leased(models.Model):
    """A row that a worker claims by a guarded UPDATE with a lease, which every later write names. ``not_before``: the
    end of its pause; ``started_at``: of the last attempt."""

    attempt = models.PositiveSmallIntegerField(_("attempt"), default=0, db_default=0)
    lease = models.UUIDField(_("lease"), null=True, blank=True, editable=False)
    leased_until = models.DateTimeField(_("leased until"), null=True, blank=True)
    worker = models.CharField(_("worker"), max_length=128, blank=True, default="", db_default="")
    not_before = models.DateTimeField(_("pauses until"), null=True, blank=True)
    started_at = models.DateTimeField(_("started"), null=True, blank=True)
    ended_at = models.DateTimeField(_("ended"), null=True, blank=True)

    class Meta:
        abstract = True


class Job(Leased):
    """A leased row that may fail by a fault: ``reason_code`` and ``reason_params``.

    ``kills``: failures while other jobs passed; ``failed_at``: of the last platform fault; ``operator_detail``: notes
    for operators; ``request_id``: of the request or task that queued it, for the log."""

    state: models.CharField  # of the kind's own states, "failed" among them
    reason_code = models.CharField(_("reason"), max_length=40, blank=True)
    reason_params = models.JSONField(_("details"), default=dict, blank=True)
    operator_detail = models.TextField(_("for operators"), blank=True)
    kills = models.PositiveSmallIntegerField(
        _("kills"), default=0, db_default=0, help_text=_("Number of failures while other jobs succeeded.")
    )
    failed_at = models.DateTimeField(_("last platform failure"), null=True, blank=True)
    request_id = models.CharField(
        _("request"), max_length=64, blank=True, default=current_request, db_default="", editable=False
    )

    class Meta:
        abstract = True

    @property
    def reason(self) -> str:
        return reason_sentence(self.reason_code, self.reason_params)

    @property
    def is_platform_fault(self) -> bool:
        """Whether it failed through our fault, and so does not count."""
        return self.state == "failed" and REASONS[self.reason_code].fault == "platform"


def lease_constraints(prefix: str, *, waiting: str, working: str, final: Sequence[str]) -> list[models.BaseConstraint]:
    """Constraints of every :class:`Leased` row on state, lease, pause and end, named with ``prefix``."""
    return [
        models.CheckConstraint(condition=Q(state__in=[waiting, working, *final]), name=f"{prefix}_state_known"),
        models.CheckConstraint(
            condition=Q(state=working, lease__isnull=False, leased_until__isnull=False, started_at__isnull=False)
            | (~Q(state=working) & Q(lease__isnull=True, leased_until__isnull=True)),
            name=f"{prefix}_lease_while_{working}",
        ),
        models.CheckConstraint(
            condition=Q(state__in=final, ended_at__isnull=False)
            | Q(state__in=[waiting, working], ended_at__isnull=True),
            name=f"{prefix}_ended_when_final",
        ),
        models.CheckConstraint(
            condition=Q(not_before__isnull=True) | Q(state=waiting), name=f"{prefix}_pauses_while_{waiting}"
        ),
    ]


class WorkerHold(models.Model):
    """A worker that claims no job by an operator's order: paused, or drained, which ends it too once it is free. There
    is no row for any other."""

    class Mode(models.TextChoices):
        """What was ordered."""

        PAUSED = "paused", _("paused")
        DRAINED = "drained", _("drained")

    worker = models.CharField(_("worker"), max_length=128, unique=True)
    mode = models.CharField(_("hold"), max_length=8, choices=Mode.choices)
    since = models.DateTimeField(_("since"))

    class Meta:
        verbose_name = _("held worker")
        verbose_name_plural = _("held workers")
        ordering = ["worker"]
        constraints = [
            models.CheckConstraint(condition=Q(mode__in=["paused", "drained"]), name="workerhold_mode_known"),
            models.CheckConstraint(condition=~Q(worker=""), name="workerhold_names_a_worker"),
        ]

    def __str__(self) -> str:
        return self.worker


class Outage(models.Model):
    """A part is out, and no job that needs it is claimed. ``looks``: failed probes; ``look_at``: the next probe."""

    class Part(models.TextChoices):
        """What can be out."""

        STORAGE = "storage", _("storage of files")

    part = models.CharField(_("part"), max_length=16, choices=Part.choices, unique=True)
    since = models.DateTimeField(_("since"))
    look_at = models.DateTimeField(_("next check"))
    looks = models.PositiveIntegerField(_("checks"), default=1)

    class Meta:
        verbose_name = _("outage")
        verbose_name_plural = _("outages")
        ordering = ["since"]
        constraints = [
            models.CheckConstraint(condition=Q(part__in=["storage"]), name="outage_part_known"),
            models.CheckConstraint(condition=Q(look_at__gt=models.F("since")), name="outage_looked_at_later"),
        ]

    def __str__(self) -> str:
        return f"{self.part} since {self.since:%Y-%m-%d %H:%M}"
