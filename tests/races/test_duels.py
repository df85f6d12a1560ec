"""Races of models against models: drawn at the close, driven round after round, counted once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction

from evaluation.models import Evaluation, State
from evaluation.services import finish_evaluation, stop_evaluation
from evaluation.signals import evaluation_ended
from evaluation.simulator.rules import RaceRules
from faults import PlatformFault, UserFault
from races import services
from races.models import Draw, Duel, DuelCar, DuelState, Entry, Race
from races.selectors import board, podiums
from races.services import (
    cancel_race,
    draw_duels,
    drive_all_on,
    drive_on,
    enter_race,
    recompute_race,
    record_ended_duel,
    remove_entry,
    repeat_submission,
    restore_entry,
    submit_model,
)
from races.services import duels as duel_services
from tests.duels import a_duel_race, drawn, driving, duel_outcome, end, end_all, qualify, seeds
from tests.factories import a_model, a_race, a_racer, drive, fail, lap, laps, start

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _commits(django_capture_on_commit_callbacks, monkeypatch):
    """What waits for the commit is done at once: a test's own transaction never commits."""
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@contextmanager
def refused(code: str) -> Iterator[None]:
    with pytest.raises(UserFault) as fault:
        yield
    assert fault.value.code == code


def points(race: Race) -> dict[int, tuple[int, int, int | None]]:
    """Points, duels and average lap of each seed."""
    rows = Entry.objects.filter(race=race, seed__isnull=False).order_by("seed")
    return {row.seed: (row.points, row.duels, row.duel_lap_ms) for row in rows}


def ranking(race: Race) -> list[str]:
    return [row.alias for row in board(race).rows]


# --- the draw


def test_the_seeds_are_the_places_in_qualifying(now):
    race = drawn(now, 4)
    assert [(row.alias, row.entry.seed) for row in board(race).rows] == [(f"car-{n}", n) for n in (1, 2, 3, 4)]
    assert (Draw.objects.get().entrants, Draw.objects.get().drawn_at) == (4, race.closes_at)


def test_drawing_and_driving_on_again_changes_nothing(now):
    race = drawn(now, 4)
    before = list(Duel.objects.values()), list(DuelCar.objects.values()), list(Entry.objects.values())
    draw_duels(race=race, now=race.closes_at + timedelta(hours=1))
    assert drive_on(race=race, now=race.closes_at + timedelta(hours=1)) == 0
    assert drive_all_on(now=race.closes_at + timedelta(hours=1)) == 0
    assert (list(Duel.objects.values()), list(DuelCar.objects.values()), list(Entry.objects.values())) == before


def test_the_periodic_task_draws_what_has_closed(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    assert drive_all_on(now=race.closes_at - timedelta(seconds=1)) == 0 and not Draw.objects.exists()
    assert drive_all_on(now=race.closes_at) == 1
    assert len(driving(race)) == 1


def test_one_race_that_cannot_go_on_does_not_hold_up_the_next(now, monkeypatch):
    broken, race = a_duel_race(now), a_duel_race(now)
    for each in (broken, race):
        qualify(each, [a_racer(), a_racer()], now)
    real = duel_services.draw_duels

    def draw(*, race: Race, now):
        if race == broken:
            raise RuntimeError("no draw today")
        return real(race=race, now=now)

    monkeypatch.setattr(duel_services, "draw_duels", draw)
    assert drive_all_on(now=race.closes_at) == 1
    assert list(Draw.objects.values_list("race", flat=True)) == [race.pk]


def test_nothing_is_drawn_before_the_race_has_closed(now):
    race = a_duel_race(now)
    with refused("duels_before_closing"):
        draw_duels(race=race, now=race.closes_at - timedelta(seconds=1))


def test_other_races_have_no_duels(now):
    race = a_race(now)
    with refused("race_has_no_duels"):
        draw_duels(race=race, now=race.closes_at)


def test_a_cancelled_race_is_never_drawn(now):
    race = a_duel_race(now)
    cancel_race(race=race, reason="Rain.", now=now)
    with refused("race_cancelled"):
        draw_duels(race=race, now=race.closes_at)
    assert drive_all_on(now=race.closes_at) == 0


def test_the_draw_waits_for_cars_that_were_sent_in_time(now, alice):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    late = submit_model(race=race, racer=alice, model=a_model(alice), now=race.closes_at - timedelta(seconds=1))
    with refused("duels_wait_for_qualifying"):
        draw_duels(race=race, now=race.closes_at)
    fail(late, UserFault("non_finite_action", step=7), race.closes_at)
    assert draw_duels(race=race, now=race.closes_at).entrants == 2


def test_only_classified_racers_who_are_in_the_race_are_drawn(now):
    race = a_duel_race(now, minimum_laps=3)
    qualify(race, [a_racer("car-1"), a_racer("car-2"), gone := a_racer("gone")], now)
    drive(race, a_racer("house", is_house=True), laps(9_000, 9_000, 9_000), now)
    drive(race, a_racer("slow"), [lap(1, 9_000), lap(2, 9_000), lap(3, 9_000, complete=False, percentage=50)], now)
    enter_race(race=race, racer=a_racer("idle"), now=now)
    services.withdraw(entry=Entry.objects.get(racer=gone), now=now)
    assert draw_duels(race=race, now=race.closes_at).entrants == 2
    assert list(Entry.objects.filter(seed__isnull=False).values_list("racer__alias", flat=True)) == ["car-1", "car-2"]


@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_the_best_by_qualifying_are_drawn_when_there_are_more(now, settings, format_):
    settings.DUELS_IN_ROUND_ROBIN = settings.DUELS_IN_BRACKET = 3
    race = drawn(now, 5, duel_format=format_)
    assert Draw.objects.get().entrants == 3
    assert ranking(race) == [f"car-{n}" for n in range(1, 6)], "who was not drawn stands behind, by qualifying"
    assert [row.rank for row in board(race).rows] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("entrants", [0, 1])
@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_a_race_of_fewer_than_two_is_over_when_it_is_drawn(now, entrants, format_):
    race = drawn(now, entrants, duel_format=format_)
    assert Draw.objects.get().over_at == race.closes_at and not Duel.objects.exists()
    assert ranking(race) == ["car-1"] * entrants


def test_qualifying_does_not_change_once_drawn(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    failed = submit_model(race=race, racer=(bob := a_racer("bob")), model=a_model(bob), now=now)
    fail(failed, PlatformFault("internal_error"), now)
    draw_duels(race=race, now=race.closes_at)
    with refused("duels_drawn"):
        repeat_submission(submission=failed, now=race.closes_at)


# --- what is queued


def test_a_heat_is_an_evaluation_of_the_front_car_with_the_others_as_rivals(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    cars = list(duel.cars.order_by("grid"))
    models = [car.entry.best.evaluation.model for car in cars]
    evaluation = duel.evaluation
    assert (evaluation.model, evaluation.owner) == (models[0], cars[0].entry.racer)
    assert [rival.model for rival in evaluation.rivals.order_by("number")] == models[1:]
    assert RaceRules.from_dict(evaluation.spec["rules"]) == services.race_rules(race)


def test_a_car_that_left_its_garage_after_qualifying_still_drives(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    for entry in race.entries.all():
        entry.best.evaluation.model.deleted_at = now
        entry.best.evaluation.model.save()
    draw_duels(race=race, now=race.closes_at)
    assert drive_on(race=race, now=race.closes_at) == 1


def test_the_heats_of_a_round_are_queued_together_and_the_next_round_follows(now):
    race = drawn(now, 4)
    first = driving(race)
    assert [duel.round for duel in first] == [1, 1]
    end(first[0], now)
    assert [duel.round for duel in driving(race)] == [1]
    end(first[1], now)
    assert [duel.round for duel in driving(race)] == [2, 2]


def test_a_racer_who_waits_for_a_lap_time_comes_before_the_duels(now, alice):
    from evaluation.services import claim_next_evaluation

    drawn(now, 4)
    race = a_race(now)
    mine = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert claim_next_evaluation(worker="w", now=now) == mine.evaluation


# --- a heat's result


def test_a_heat_gives_places_points_and_the_average_of_complete_laps(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1], times={1: [11_000, 11_000, 11_000], 2: [9_000, 9_001]})
    duel.refresh_from_db()
    assert (duel.state, duel.decided_at) == (DuelState.DECIDED, now)
    rows = duel.cars.order_by("place").values_list("entry__seed", "place", "points", "laps", "time_ms")
    assert list(rows) == [(2, 1, 1, 2, 18_001), (1, 2, 0, 3, 33_000)]
    assert points(race) == {1: (0, 1, 11_000), 2: (1, 1, 9_000)}
    assert ranking(race) == ["car-2", "car-1"]


def test_a_car_that_retires_has_lost_to_every_other(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    end(duel, now, winners=[3, 1, 2, 4], retired=[3])
    rows = duel.cars.order_by("place").values_list("entry__seed", "points", "retired_code")
    assert list(rows) == [(1, 3, ""), (2, 2, ""), (4, 1, ""), (3, 0, "non_finite_action")]


def test_a_result_counts_once(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1])
    before = points(race), list(DuelCar.objects.values())
    evaluation = Evaluation.objects.get(pk=duel.evaluation_id)
    assert record_ended_duel(evaluation=evaluation, result=evaluation.result, now=now) is None
    evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=evaluation.result, now=now)
    assert (points(race), list(DuelCar.objects.values())) == before


def test_when_the_points_cannot_be_written_the_result_is_not_either(now, monkeypatch):
    race = drawn(now, 2)
    (duel,) = driving(race)
    running = start(Evaluation.objects.get(duel=duel), now)

    def broken(*args):
        raise RuntimeError("no points today")

    monkeypatch.setattr(duel_services, "recount", broken)
    with pytest.raises(RuntimeError):
        finish_evaluation(evaluation_id=running.pk, lease=running.lease, outcome=duel_outcome([0, 1], {}, []), now=now)
    running.refresh_from_db()
    duel.refresh_from_db()
    assert (running.state, duel.state) == (State.RUNNING, DuelState.DRIVING), "it will be tried again"


def test_when_the_next_round_cannot_be_queued_the_result_stands_and_the_task_goes_on(now, monkeypatch):
    race = drawn(now, 2)
    (duel,) = driving(race)

    def broken(**options):
        raise RuntimeError("no queue today")

    with monkeypatch.context() as patch:
        patch.setattr(duel_services, "queue_evaluation", broken)
        end(duel, now)
    assert points(race)[1][0] == 1 and not driving(race)
    assert drive_all_on(now=race.closes_at) == 1


def test_working_out_the_standings_anew_changes_nothing(now):
    race = drawn(now, 4)
    end_all(race, race.closes_at, choose=max)
    before = list(Entry.objects.values())
    recompute_race(race=race)
    assert list(Entry.objects.values()) == before


# --- to the end


@pytest.mark.parametrize(("entrants", "cars", "heats"), [(4, 2, 12), (5, 2, 20), (5, 3, 10), (4, 4, 8), (3, 4, 6)])
def test_a_round_robin_goes_to_its_end_and_the_one_that_always_wins_leads(now, entrants, cars, heats):
    race = drawn(now, entrants, duel_cars=cars)
    assert end_all(race, now, choose=max) == heats
    assert Draw.objects.get().over_at == now
    assert ranking(race)[0] == f"car-{entrants}"
    assert sum(each for each, *_ in points(race).values()) == heats * sum(range(min(cars, entrants)))


@pytest.mark.parametrize("entrants", [2, 3, 4, 5, 8])
def test_a_bracket_goes_to_its_final_and_its_winner_leads(now, entrants):
    race = drawn(now, entrants, duel_format="bracket")
    assert end_all(race, now, choose=max) == 2 * (entrants - 1)
    assert Draw.objects.get().over_at == now
    assert ranking(race)[0] == f"car-{entrants}"
    table = points(race)
    assert table[entrants][0] == (entrants - 1).bit_length()
    assert all(each < table[entrants] for seed, each in table.items() if seed != entrants)


def test_a_bye_counts_as_a_tie_won(now):
    race = drawn(now, 3, duel_format="bracket")
    assert [seeds(duel) for duel in driving(race)] == [[2, 3], [3, 2]]
    assert {seed: each for seed, (each, *_) in points(race).items()} == {1: 1, 2: 0, 3: 0}


def test_a_tie_that_is_even_goes_to_the_faster_over_both_heats(now):
    race = drawn(now, 2, duel_format="bracket")
    one, other = driving(race)
    end(one, now, winners=[1, 2], times={1: [10_000] * 3, 2: [10_100] * 3})
    end(other, now, winners=[2, 1], times={1: [11_000] * 3, 2: [9_000] * 3})
    assert ranking(race) == ["car-2", "car-1"]
    assert {seed: each for seed, (each, *_) in points(race).items()} == {1: 0, 2: 1}


def test_equal_points_go_by_average_lap_and_then_by_seed(now):
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


# --- what goes wrong


def test_a_heat_that_fails_through_our_fault_is_repeated_and_then_void(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    runs = set()
    for _ in range(duel_services.MAX_TRIES):
        duel.refresh_from_db()
        runs.add(duel.evaluation_id)
        break_down(duel, now)
    duel.refresh_from_db()
    assert (duel.state, duel.tries, len(runs)) == (DuelState.VOID, 3, 3)
    assert set(duel.cars.values_list("points", "place")) == {(None, None)}
    assert [each.round for each in driving(race)] == [2], "the race goes on"
    assert points(race) == {1: (0, 0, None), 2: (0, 0, None)}


def break_down(duel: Duel, now) -> None:
    from evaluation.services import fail_evaluation

    evaluation = Evaluation.objects.get(duel=duel)
    while not evaluation.is_final:
        running = start(evaluation, now)
        fault = PlatformFault("internal_error")
        assert fail_evaluation(evaluation_id=running.pk, lease=running.lease, fault=fault, now=now)
        evaluation.refresh_from_db()


def test_a_repeated_heat_counts_like_any_other(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    break_down(duel, now)
    (again,) = driving(race)
    assert again == duel and again.evaluation != duel.evaluation and again.tries == 2
    end(again, now, winners=[2, 1])
    assert points(race)[2][0] == 1


def test_a_tie_whose_heats_are_void_goes_to_the_better_seed(now):
    race = drawn(now, 2, duel_format="bracket")
    while heats := driving(race):
        for duel in heats:
            break_down(duel, now)
    assert Draw.objects.get().over_at is not None
    assert ranking(race) == ["car-1", "car-2"]


def test_a_heat_that_an_admin_stops_is_driven_again(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    stop_evaluation(evaluation=duel.evaluation, now=now)
    (again,) = driving(race)
    assert again == duel and again.evaluation != duel.evaluation


# --- who leaves


def remove(race: Race, seed: int, now) -> Entry:
    entry = Entry.objects.get(race=race, seed=seed)
    admin = entry.racer.__class__.objects.filter(is_staff=True).first() or a_racer("sam", is_staff=True)
    return remove_entry(entry=entry, by=admin, now=now, reason="Not theirs.")


def test_a_removed_racer_forfeits_what_is_not_decided(now):
    race = drawn(now, 2)
    (first,) = driving(race)
    end(first, now, winners=[2, 1])
    remove(race, 2, now)
    assert not driving(race) and Draw.objects.get().over_at == now
    last = Duel.objects.get(round=2)
    assert last.is_walkover and last.evaluation is None
    assert set(last.cars.values_list("entry__seed", "points", "forfeited")) == {(1, 1, False), (2, 0, True)}
    assert [(row.alias, row.rank, row.entry.points) for row in board(race).rows] == [("car-1", 1, 1)]


def test_the_car_of_a_removed_racer_is_stopped_and_the_others_drive_without_it(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    before = duel.evaluation
    remove(race, 3, now)
    (again,) = driving(race)
    before.refresh_from_db()
    assert before.state == State.STOPPED and again == duel and again.tries == 1, "that cost no try"
    assert again.evaluation.rivals.count() == 2
    end(again, now, winners=[4, 1, 2])
    rows = duel.cars.order_by("place").values_list("entry__seed", "points")
    assert list(rows) == [(4, 3), (1, 2), (2, 1), (3, 0)]


def test_when_all_but_one_leave_the_rest_is_walkovers(now):
    race = drawn(now, 4, duel_format="bracket")
    for seed in (1, 2, 3):
        remove(race, seed, now)
    assert Draw.objects.get().over_at == now
    assert [row.alias for row in board(race).rows] == ["car-4"]
    assert points(race)[4][0] == 2


def test_a_restored_racer_drives_what_is_left(now):
    race = drawn(now, 3)
    entry = remove(race, 1, now)
    restore_entry(entry=entry, by=a_racer("tom", is_staff=True))
    end_all(race, now)
    assert points(race)[1][0] >= 2


# --- what the database refuses


@pytest.mark.parametrize(
    "change",
    [
        {"state": "decided"},
        {"decided_at": "2026-01-01T00:00Z"},
        {"evaluation": None},
        {"state": "lost"},
        {"number": 0},
    ],
)
def test_a_heat_that_contradicts_itself_is_refused(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        Duel.objects.filter(pk=driving(race)[0].pk).update(**change)


@pytest.mark.parametrize(
    "change",
    [
        {"points": 1},
        {"place": 1},
        {"laps": 1},
        {"grid": 0},
        {"place": 1, "points": 9},
        {"place": 1, "points": 1, "forfeited": True},
        {"grid": 2},
    ],
)
def test_a_car_with_points_before_the_end_or_more_than_there_are_is_refused(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelCar.objects.filter(duel=driving(race)[0], grid=1).update(**change)


@pytest.mark.parametrize("change", [{"points": 1}, {"rank_score": 5}, {"seed": 2}, {"seed": None}, {"rank_lap": 5}])
def test_a_standing_that_does_not_follow_from_the_duels_is_refused(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        Entry.objects.filter(race=race, seed=1).update(**change)


def test_a_racer_is_once_in_a_heat_and_a_heat_once_in_a_round(now):
    race = drawn(now, 2)
    car = driving(race)[0].cars.first()
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelCar.objects.create(duel=car.duel, entry=car.entry, grid=3)
    with pytest.raises(IntegrityError), transaction.atomic():
        Duel.objects.create(race=race, round=1, number=1)


def test_a_bracket_of_more_than_pairs_is_refused(now):
    with pytest.raises(IntegrityError), transaction.atomic():
        a_duel_race(now, duel_format="bracket", duel_cars=3)
    race = Race(race_type="head_to_head", opponents="models", duel_format="bracket", duel_cars=3)
    assert set(race_problems(race)) == {"duel_cars"}


def race_problems(race: Race) -> dict:
    from races.models.course import problems_of

    return problems_of(race)


# --- admins look


def test_admins_look_at_draws_and_duels_and_edit_none(now, client):
    admin = a_racer("sam", is_staff=True, is_superuser=True)
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1])
    client.force_login(admin, backend="django.contrib.auth.backends.ModelBackend")
    for path in ("draw/", f"draw/{race.pk}/change/", "duel/", f"duel/{duel.pk}/change/", "duel/?q=car-2"):
        assert client.get(f"/admin/races/{path}").status_code == 200, path
    page = client.get(f"/admin/races/duel/{duel.pk}/change/").content.decode()
    assert "car-2" in page and 'name="_save"' not in page
    assert client.get("/admin/races/duel/add/").status_code == 403
