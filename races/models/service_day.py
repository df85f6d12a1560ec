"""How the platform served submissions, by day."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _


class ServiceDay(models.Model):
    """A day (UTC) in figures, for the status page.

    ``p50_ms``, ``p95_ms``: from a submission to its result on the board; ``faults``: runs whose last platform fault was
    then; ``given_back``: runs that ended by one, and count for nobody."""

    day = models.DateField(primary_key=True)
    runs = models.PositiveIntegerField(default=0)
    p50_ms = models.PositiveBigIntegerField(null=True)
    p95_ms = models.PositiveBigIntegerField(null=True)
    faults = models.PositiveIntegerField(default=0)
    given_back = models.PositiveIntegerField(default=0)

    class Meta:
        verbose_name = _("day of service")
        verbose_name_plural = _("days of service")
        ordering = ["day"]
        constraints = [
            models.CheckConstraint(
                condition=Q(runs=0, p50_ms=None, p95_ms=None) | Q(runs__gt=0, p95_ms__gte=models.F("p50_ms")),
                name="service_day_of_runs",
            )
        ]

    def __str__(self) -> str:
        return self.day.isoformat()
