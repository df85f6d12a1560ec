"""Draws, results and removals at the same moment: on SQLite here, on PostgreSQL with the rest of this folder."""

from __future__ import annotations

import pytest

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from races.duels.services import draw_duels, drive_all_on, drive_on
from races.entries.services.entries import remove_entry
from races.models import Draw, Duel, DuelCompetitor, DuelState, Entry
from tests.duels import a_duel_race, drawn, driving, duel_outcome, end_all, qualify
from tests.factories import a_racer, start
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db(transaction=True)


def finishing(duel: Duel, now):
    """A call that ends a heat which is on track; the front car wins."""
    running = start(Evaluation.objects.get(duel=duel), now)
    result = duel_outcome(range(duel.cars.filter(forfeited=False).count()), {}, [])
    return lambda: finish_evaluation(pk=running.pk, lease=running.lease, outcome=result, now=now)


def test_concurrent_draws_draw_a_race_once(now):
    race = a_duel_race(now)
    qualify(race, [a_racer() for _ in range(4)], now)
    later = race.closes_at
    calls = [lambda: draw_duels(race=race, now=later).entrants for _ in range(3)]
    answers = at_once([*calls, lambda: drive_all_on(now=later), lambda: drive_all_on(now=later)])
    assert answers[:3] == [4, 4, 4], answers
    drive_on(race=race, now=later)
    assert (Draw.objects.count(), Duel.objects.count(), DuelCompetitor.objects.count()) == (1, 12, 24)
    assert sorted(Entry.objects.values_list("seed", flat=True)) == [1, 2, 3, 4]
    assert Evaluation.objects.filter(duel__isnull=False).count() == len(driving(race)) == 2


@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_heats_ending_at_once_queue_the_next_round_once(now, format_):
    race = drawn(now, 4, duel_format=format_)
    heats = driving(race)
    assert at_once([finishing(duel, now) for duel in heats]) == [True] * len(heats)
    assert Duel.objects.filter(race=race, round=1, state=DuelState.DECIDED).count() == len(heats)
    assert sum(DuelCompetitor.objects.filter(duel__round=1).values_list("points", flat=True)) == len(heats)
    assert {duel.round for duel in driving(race)} == {2}
    assert Evaluation.objects.filter(rivals__isnull=False).count() == len(heats) + len(driving(race))
    assert sum(Entry.objects.values_list("points", flat=True)) == 2


def test_a_removal_at_the_end_of_a_heat_counts_it_or_forfeits_it(now):
    race = drawn(now, 3, duel_format="bracket")
    one, other = driving(race)
    admin = a_racer("sam", is_staff=True)
    entry = Entry.objects.get(race=race, seed=3)
    answers = at_once(
        [
            finishing(one, now),
            finishing(other, now),
            lambda: remove_entry(entry=entry, by=admin, now=now) and None,
            lambda: drive_on(race=race, now=now),
        ]
    )
    assert not [one for one in answers if isinstance(one, BaseException)], answers
    end_all(race, now)
    assert Draw.objects.get().over_at is not None
    assert set(Duel.objects.values_list("state", flat=True)) == {DuelState.DECIDED}
    assert Duel.objects.count() == 4
