"""Races of models against models: driven round after round, counted once."""

from __future__ import annotations

import pytest

from evaluation.models import Evaluation, State
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.signals import evaluation_ended
from paddock.rules.race import RaceRules
from races.boards.selectors.board import podiums
from races.duels import services as duel_services
from races.duels.services import draw_duels, drive_all_on, drive_on, record_ended_duel
from races.entries.services.standings import recompute_race
from races.entries.services.submissions import submit_model
from races.models import Draw, DuelCompetitor, DuelState, Entry
from races.rules.layout import race_rules
from tests.duels import (
    a_duel_race,
    drawn,
    driving,
    duel_outcome,
    end,
    end_all,
    points,
    qualify,
    ranking,
    seeds,
)
from tests.factories import a_model, a_race, a_racer, start
from tests.soak import only

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("commits")]


# --- what is queued


def test_a_heat_evaluates_the_front_car_with_the_others_as_rivals(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    cars = list(duel.cars.order_by("grid"))
    models = [car.entry.best.evaluation.model for car in cars]
    evaluation = duel.evaluation
    assert (evaluation.model, evaluation.owner) == (models[0], cars[0].entry.racer)
    assert [rival.model for rival in evaluation.rivals.order_by("number")] == models[1:]
    assert RaceRules.from_dict(evaluation.spec["rules"]) == race_rules(race)


def test_a_model_deleted_after_qualifying_still_drives(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    for entry in race.entries.all():
        entry.best.evaluation.model.deleted_at = now
        entry.best.evaluation.model.save()
    draw_duels(race=race, now=race.closes_at)
    assert drive_on(race=race, now=race.closes_at) == 1


def test_heats_of_a_round_are_queued_together(now):
    race = drawn(now, 4)
    first = driving(race)
    assert [duel.round for duel in first] == [1, 1]
    end(first[0], now)
    assert [duel.round for duel in driving(race)] == [1]
    end(first[1], now)
    assert [duel.round for duel in driving(race)] == [2, 2]


def test_a_waiting_submission_goes_before_the_duels(now, alice):
    from evaluation.running.queue.jobs import EVALUATIONS

    drawn(now, 4)
    race = a_race(now)
    mine = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert EVALUATIONS.claim(worker="w", now=now) == mine.evaluation


# --- a heat's result


def test_a_heat_yields_places_points_and_the_average_lap(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1], times={1: [11_000, 11_000, 11_000], 2: [9_000, 9_001]})
    duel.refresh_from_db()
    assert (duel.state, duel.decided_at) == (DuelState.DECIDED, now)
    rows = duel.cars.order_by("place").values_list("entry__seed", "place", "points", "laps", "time_ms")
    assert list(rows) == [(2, 1, 1, 2, 18_001), (1, 2, 0, 3, 33_000)]
    assert points(race) == {1: (0, 1, 11_000), 2: (1, 1, 9_000)}
    assert ranking(race) == ["car-2", "car-1"]


def test_a_retired_car_loses_to_every_other(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    end(duel, now, winners=[3, 1, 2, 4], retired=[3])
    rows = duel.cars.order_by("place").values_list("entry__seed", "points", "retired_code")
    assert list(rows) == [(1, 3, ""), (2, 2, ""), (4, 1, ""), (3, 0, "non_finite_action")]


def test_a_heats_result_counts_once(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1])
    before = points(race), list(DuelCompetitor.objects.values())
    evaluation = Evaluation.objects.get(pk=duel.evaluation_id)
    assert record_ended_duel(evaluation=evaluation, result=evaluation.result, now=now) is None
    evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=evaluation.result, now=now)
    assert (points(race), list(DuelCompetitor.objects.values())) == before


def test_a_result_is_not_written_without_its_points(now, monkeypatch):
    race = drawn(now, 2)
    (duel,) = driving(race)
    running = start(Evaluation.objects.get(duel=duel), now)

    def broken(*args):
        raise RuntimeError("no points today")

    monkeypatch.setattr(duel_services, "recount", broken)
    with pytest.raises(RuntimeError):
        finish_evaluation(pk=running.pk, lease=running.lease, outcome=duel_outcome([0, 1], {}, []), now=now)
    running.refresh_from_db()
    duel.refresh_from_db()
    assert (running.state, duel.state) == (State.RUNNING, DuelState.DRIVING), "it will be tried again"


def test_a_result_stands_if_the_next_round_cannot_be_queued(now, monkeypatch):
    race = drawn(now, 2)
    (duel,) = driving(race)

    def broken(**options):
        raise RuntimeError("no queue today")

    with monkeypatch.context() as patch:
        patch.setattr(duel_services, "queue_evaluation", broken)
        end(duel, now)
    assert points(race)[1][0] == 1 and not driving(race)
    assert drive_all_on(now=race.closes_at) == 1


def test_recomputing_the_standings_changes_nothing(now):
    race = drawn(now, 4)
    end_all(race, race.closes_at, choose=max)
    before = list(Entry.objects.values())
    recompute_race(race=race)
    assert list(Entry.objects.values()) == before


# --- to the end


@pytest.mark.parametrize(
    ("entrants", "cars", "heats"),
    only([(4, 2, 12), (3, 4, 6)], [(4, 2, 12), (5, 2, 20), (5, 3, 10), (4, 4, 8), (3, 4, 6)]),
)
def test_the_constant_winner_leads_a_finished_round_robin(now, entrants, cars, heats):
    race = drawn(now, entrants, duel_cars=cars)
    assert end_all(race, now, choose=max) == heats
    assert Draw.objects.get().over_at == now
    assert ranking(race)[0] == f"car-{entrants}"
    assert sum(each for each, *_ in points(race).values()) == heats * sum(range(min(cars, entrants)))


@pytest.mark.parametrize("entrants", only([2, 5], [2, 3, 4, 5, 8]))
def test_the_winner_of_the_final_leads_a_finished_bracket(now, entrants):
    race = drawn(now, entrants, duel_format="bracket")
    assert end_all(race, now, choose=max) == 2 * (entrants - 1)
    assert Draw.objects.get().over_at == now
    assert ranking(race)[0] == f"car-{entrants}"
    table = points(race)
    assert table[entrants][0] == (entrants - 1).bit_length()
    assert all(each < table[entrants] for seed, each in table.items() if seed != entrants)


def test_a_bye_counts_as_a_won_tie(now):
    race = drawn(now, 3, duel_format="bracket")
    assert [seeds(duel) for duel in driving(race)] == [[2, 3], [3, 2]]
    assert {seed: each for seed, (each, *_) in points(race).items()} == {1: 1, 2: 0, 3: 0}


def test_an_even_tie_goes_to_the_faster_car_over_both_heats(now):
    race = drawn(now, 2, duel_format="bracket")
    one, other = driving(race)
    end(one, now, winners=[1, 2], times={1: [10_000] * 3, 2: [10_100] * 3})
    end(other, now, winners=[2, 1], times={1: [11_000] * 3, 2: [9_000] * 3})
    assert ranking(race) == ["car-2", "car-1"]
    assert {seed: each for seed, (each, *_) in points(race).items()} == {1: 0, 2: 1}


def test_equal_points_are_ranked_by_average_lap_then_seed(now):
    race = drawn(now, 3)
    while heats := driving(race):
        for duel in heats:
            cars = seeds(duel)
            loser = {frozenset({1, 2}): 1, frozenset({2, 3}): 2, frozenset({1, 3}): 3}[frozenset(cars)]
            times = {1: [10_000], 2: [10_000], 3: [9_999]}
            end(duel, now, winners=sorted(cars, key=lambda car, last=loser: car == last), times=times)
    assert points(race) == {1: (2, 4, 10_000), 2: (2, 4, 10_000), 3: (2, 4, 9_999)}
    assert ranking(race) == ["car-3", "car-1", "car-2"]
    assert [row.alias for row in podiums([race])[race.pk]] == ["car-3", "car-1", "car-2"]
