"""Days of service: how long results took, and the platform's own faults."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from evaluation.models import Evaluation
from races.models import Race, ServiceDay
from races.runs.service_days import DAYS, measure_days
from tests.factories import a_model, a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db
NOW = datetime(2026, 11, 15, 12, 0, tzinfo=UTC)


def run_of(race: Race, name: str, took_s: float, ended_at: datetime = NOW) -> Evaluation:
    """A submission whose result took that long."""
    evaluation = drive(race, a_racer(name), laps(10_000), NOW).evaluation
    Evaluation.objects.filter(pk=evaluation.pk).update(
        queued_at=ended_at - timedelta(seconds=took_s), started_at=ended_at, ended_at=ended_at
    )
    return evaluation


def test_a_day_has_the_nearest_ranks_of_its_runs(wakes):
    race = a_race(NOW)
    for number, took in enumerate((1, 2, 3, 4, 100)):
        run_of(race, f"racer{number}", took)
    run_of(race, "earlier", 50, NOW - timedelta(days=1))
    measure_days(now=NOW)
    today, before = ServiceDay.objects.order_by("-day")[:2]
    assert (today.runs, today.p50_ms, today.p95_ms) == (5, 3_000, 100_000)
    assert (before.runs, before.p50_ms, before.p95_ms) == (1, 50_000, 50_000)


def test_runs_of_the_house_and_runs_without_a_race_do_not_count(wakes):
    race, house = a_race(NOW), a_racer("house-one", is_house=True)
    drive(race, house, laps(10_000), NOW)
    a_model(house)
    measure_days(now=NOW)
    assert ServiceDay.objects.get(day=NOW.date()).runs == 0


def test_faults_of_the_platform_and_what_was_given_back_are_counted(wakes):
    race = a_race(NOW)
    again, lost = run_of(race, "again", 1), run_of(race, "lost", 1)
    Evaluation.objects.filter(pk__in=(again.pk, lost.pk)).update(failed_at=NOW - timedelta(minutes=1), attempt=1)
    Evaluation.objects.filter(pk=lost.pk).update(state="failed", reason_code="platform_gave_up")
    measure_days(now=NOW)
    today = ServiceDay.objects.get(day=NOW.date())
    assert (today.runs, today.faults, today.given_back) == (1, 2, 1)


def test_thirty_days_are_measured_once_and_then_only_the_last_two(wakes):
    assert measure_days(now=NOW) == DAYS
    assert measure_days(now=NOW + timedelta(minutes=5)) == 2
    assert measure_days(now=NOW + timedelta(days=1)) == 2
    assert ServiceDay.objects.count() == DAYS
    assert min(ServiceDay.objects.values_list("day", flat=True)) == (NOW - timedelta(days=DAYS - 2)).date()
