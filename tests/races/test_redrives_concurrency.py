"""Several sweeps, workers and racers at the moment in which a race is driven again: on SQLite, and on PostgreSQL."""

from __future__ import annotations

from functools import partial

import pytest

from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.redrives import drive_again, sweep_redrives
from races.entries.services.standings import recompute_race
from races.entries.services.submissions import submit_model
from races.models import Race, Redrive, Retiming
from tests.factories import a_model, a_race, a_racer, drive, laps, outcome, start
from tests.races.test_concurrency import at_once
from tests.redrives import SITE, end, everything, pending, shown

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def race(monkeypatch, now) -> Race:
    monkeypatch.setattr(SITE, "engine-of-before")
    race = a_race(now)
    for number, name in enumerate(("ann", "bob", "cat")):
        drive(race, a_racer(name), laps(*[10_000 + 1000 * number] * 3), now)
    monkeypatch.setattr(SITE, "engine-of-now")
    return race


def test_concurrent_sweeps_queue_each_run_once(race, now):
    answers = at_once([partial(sweep_redrives, now=now)] * 3)
    assert sorted(answers) == [0, 0, 3], answers
    assert Redrive.objects.count() == 3


def test_last_results_sweeps_and_a_new_car_all_count_once(race, now):
    sweep_redrives(now=now)
    first, second, third = pending(race)
    end(first, laps(9_000, 9_000, 9_000), now)
    dan = a_racer("dan")
    new = submit_model(race=race, racer=dan, model=a_model(dan), now=now)
    runs = [start(one, now) for one in (second.evaluation, third.evaluation, new.evaluation)]
    calls = [
        partial(finish_evaluation, pk=run.pk, lease=run.lease, outcome=outcome(laps(*[time] * 3)), now=now)
        for run, time in zip(runs, (9_100, 9_200, 8_000), strict=True)
    ]
    answers = at_once([*calls, *[partial(drive_again, race=race, now=now)] * 2])
    assert answers[:3] == [True] * 3, answers
    assert answers[3:] == [0, 0]
    sweep_redrives(now=now)
    assert shown(race) == [("dan", 8_000), ("ann", 9_000), ("bob", 9_100), ("cat", 9_200)]
    assert Retiming.objects.count() == 3
    stands = everything(race)
    recompute_race(race=Race.objects.get(pk=race.pk))
    assert everything(race) == stands
