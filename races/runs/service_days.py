"""Measures how the platform served submissions, by day."""

from datetime import UTC, date, datetime, time, timedelta

from django.db.models import DurationField, ExpressionWrapper, F, QuerySet

from evaluation.models import Evaluation, State
from paddock.errors.reasons import REASONS

from ..models import ServiceDay

DAYS = 30


def measure_days(*, now: datetime) -> int:
    """Measure today, yesterday and missing days of the last :data:`DAYS`; forget older ones. Returns how many."""
    today = now.astimezone(UTC).date()
    shown = [today - timedelta(days=back) for back in range(DAYS)]
    known = set(ServiceDay.objects.filter(day__in=shown).values_list("day", flat=True))
    due = [day for day in shown if day not in known or day >= today - timedelta(days=1)]
    for day in due:
        ServiceDay.objects.update_or_create(day=day, defaults=_figures(day))
    ServiceDay.objects.filter(day__lt=shown[-1]).delete()
    return len(due)


def _figures(day: date) -> dict[str, int | None]:
    begin = datetime.combine(day, time(), UTC)
    within = (begin, begin + timedelta(days=1) - timedelta(microseconds=1))
    ended = Evaluation.objects.filter(ended_at__range=within, submission__isnull=False, owner__is_house=False)
    finished = ended.filter(state=State.FINISHED)
    runs = finished.count()
    ours = [code for code, reason in REASONS.items() if reason.fault == "platform"]
    # by their end first, for which there is an index
    failed = Evaluation.objects.filter(submission__isnull=False, failed_at__range=within)
    faults = failed.filter(ended_at__gte=begin).count() + failed.filter(ended_at=None).count()
    return {
        "runs": runs,
        "p50_ms": _percentile(finished, runs, 50),
        "p95_ms": _percentile(finished, runs, 95),
        "faults": faults,
        "given_back": ended.filter(state=State.FAILED, reason_code__in=ours).count(),
    }


def _percentile(finished: QuerySet[Evaluation], runs: int, percent: int) -> int | None:
    """The least time within which ``percent`` of the runs were done."""
    if not runs:
        return None
    took = ExpressionWrapper(F("ended_at") - F("queued_at"), output_field=DurationField())
    place = -(-runs * percent // 100) - 1
    waited = finished.annotate(took=took).order_by("took").values_list("took", flat=True)[place]
    return max(0, int(waited.total_seconds() * 1000))
