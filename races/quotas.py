"""Quotas of a racer: races they organise and their test drives."""

from datetime import datetime, timedelta

from django.db.models import Count, Q, QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, only
from evaluation.models import State
from paddock.errors.reasons import platform_codes

from .models import OwnEvaluation, Race, RaceKind

A_DAY = timedelta(days=1)


def _races(racers: Racers, now: datetime) -> CountedRows:
    """Community races that are neither over nor cancelled."""
    held = Race.objects.filter(kind=RaceKind.COMMUNITY, cancelled_at=None, closes_at__gt=now).exclude(organiser=None)
    return only(held, "organiser", racers).order_by().values_list("organiser").annotate(Count("pk"))


def _own_at_once(racers: Racers, now: datetime) -> CountedRows:
    """Own runs that wait or drive."""
    under_way = _own(racers).filter(evaluation__state__in=(State.QUEUED, State.RUNNING))
    return under_way.values_list("owner").annotate(Count("pk"))


def _own_a_day(racers: Racers, now: datetime) -> CountedRows:
    """Test drives of the last 24 hours, deleted ones too, without platform failures and those stopped before they
    began."""
    nothing = Q(evaluation__state=State.FAILED, evaluation__reason_code__in=platform_codes())
    nothing |= Q(evaluation__state=State.STOPPED, evaluation__started_at=None)
    asked = _own(racers).filter(Q(evaluation=None) | ~nothing, asked_at__gt=now - A_DAY)
    return asked.values_list("owner").annotate(Count("pk"))


def _own(racers: Racers) -> QuerySet[OwnEvaluation]:
    return only(OwnEvaluation.objects.order_by(), "owner", racers)


RACES = Quota(4, "races", "RACES_PER_RACER", _("Simultaneous races"), _races)
OWN_RUNS_AT_ONCE = Quota(9, "own_runs_at_once", "OWN_RUNS_AT_ONCE", _("Test runs in progress"), _own_at_once)
OWN_RUNS_A_DAY = Quota(10, "own_runs_a_day", "OWN_RUNS_A_DAY", _("Test runs in 24 hours"), _own_a_day)
