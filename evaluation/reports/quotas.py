"""How many reports a racer may ask for and keep."""

from datetime import datetime, timedelta

from django.db.models import Count, Q, QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, only
from paddock.errors.reasons import platform_codes

from ..models import State
from ..models.reports import UNDER_WAY, CarReport

A_DAY = timedelta(days=1)


def _at_once(racers: Racers, now: datetime) -> CountedRows:
    return _counted(_of(racers).filter(state__in=UNDER_WAY))


def _a_day(racers: Racers, now: datetime) -> CountedRows:
    """Those asked for in the 24 hours before ``now``, deleted ones too; not what failed through our fault or was
    stopped before it began."""
    nothing = Q(state=State.FAILED, reason_code__in=platform_codes()) | Q(state=State.STOPPED, started_at=None)
    return _counted(_of(racers).filter(asked_at__gt=now - A_DAY).exclude(nothing))


def _kept(racers: Racers, now: datetime) -> CountedRows:
    return _counted(_of(racers).filter(deleted_at=None))


def _counted(reports: QuerySet[CarReport]) -> CountedRows:
    return reports.values_list("owner").annotate(Count("pk"))


def _of(racers: Racers) -> QuerySet[CarReport]:
    return only(CarReport.objects.order_by(), "owner", racers)


AT_ONCE = Quota(11, "reports_at_once", "REPORTS_AT_ONCE", _("Reports in progress"), _at_once)
DAILY = Quota(12, "reports_a_day", "REPORTS_A_DAY", _("Reports in 24 hours"), _a_day)
KEPT = Quota(13, "reports", "REPORTS_PER_RACER", _("Reports kept"), _kept)
ALL = (AT_ONCE, DAILY, KEPT)
