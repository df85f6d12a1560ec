"""Draws each night's sample of official results, and ends the alarm of a difference."""

from datetime import date, datetime
from random import Random

from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet

from evaluation.models import Evaluation

from ..entries.engines import is_over, site_engine
from ..models import Entry, Race, Recheck
from .jobs import RECHECKS

LOOKED_AT = 4  # times the sample: results of races that are not over yet are passed by


@transaction.atomic
def draw_sample(*, now: datetime) -> int:
    """Queue the sample of today (UTC) once its hour has come. Returns how many were queued: 0 where it was drawn
    before. The day alone decides which places of the list of results are drawn."""
    day = now.date()
    size = settings.RECHECK_SAMPLE
    if not size or now.hour < settings.RECHECK_HOUR or Recheck.objects.filter(day=day).exists():
        return 0
    drawn = [
        Recheck(day=day, number=number, evaluation_id=pk, queued_at=now)
        for number, pk in enumerate(_drawn(day, size, now), 1)
    ]
    Recheck.objects.bulk_create(drawn, ignore_conflicts=True)  # another scheduler may be at it
    if drawn:
        RECHECKS.wake(times=min(len(drawn), RECHECKS.wakes))
    return len(drawn)


def examine(*, rechecks: QuerySet[Recheck], now: datetime) -> int:
    """An admin has seen to these differences: their alarm ends. Returns how many there were."""
    return unexamined().filter(pk__in=rechecks.values("pk")).update(examined_at=now)


def unexamined() -> QuerySet[Recheck]:
    """Differences that nobody has seen to."""
    return Recheck.objects.filter(same=False, examined_at=None)


def _drawn(day: date, size: int, now: datetime) -> list[int]:
    results = Entry.objects.filter(
        best__evaluation__result__engine=site_engine(),
        race__closes_at__lte=now,
        race__cancelled_at=None,
        race__imported_at=None,
    ).order_by("pk")
    count = results.count()
    places = Random(day.isoformat()).sample(range(count), min(count, LOOKED_AT * size))
    over: dict[int, bool] = {}
    chosen: list[int] = []
    for place in places:
        entry = results.select_related("race", "best")[place : place + 1].get()
        race: Race = entry.race
        if race.pk not in over:
            over[race.pk] = is_over(race, now)
        assert entry.best is not None
        if over[race.pk] and entry.best.evaluation_id not in chosen:
            chosen.append(entry.best.evaluation_id)
    return list(Evaluation.objects.filter(pk__in=chosen[:size]).order_by("pk").values_list("pk", flat=True))
