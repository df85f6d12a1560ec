"""Races of models against models are drawn at the close, from qualifying."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

import pytest

from paddock.errors import PlatformFault, UserFault
from races.boards.selectors.board import board
from races.duels import services as duel_services
from races.duels.services import draw_duels, drive_all_on, drive_on
from races.entries.services.entries import enter_race, withdraw
from races.entries.services.submissions import repeat_submission, submit_model
from races.models import Draw, Duel, DuelCompetitor, Entry, Race
from races.pages.services import cancel_race
from tests.duels import (
    a_duel_race,
    drawn,
    driving,
    qualify,
    ranking,
)
from tests.factories import a_model, a_race, a_racer, drive, fail, lap, laps

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("commits")]


@contextmanager
def refused(code: str) -> Iterator[None]:
    with pytest.raises(UserFault) as fault:
        yield
    assert fault.value.code == code


def test_seeds_are_the_qualifying_places(now):
    race = drawn(now, 4)
    assert [(row.alias, row.entry.seed) for row in board(race).rows] == [(f"car-{n}", n) for n in (1, 2, 3, 4)]
    assert (Draw.objects.get().entrants, Draw.objects.get().drawn_at) == (4, race.closes_at)


def test_repeating_the_draw_changes_nothing(now):
    race = drawn(now, 4)
    before = list(Duel.objects.values()), list(DuelCompetitor.objects.values()), list(Entry.objects.values())
    draw_duels(race=race, now=race.closes_at + timedelta(hours=1))
    assert drive_on(race=race, now=race.closes_at + timedelta(hours=1)) == 0
    assert drive_all_on(now=race.closes_at + timedelta(hours=1)) == 0
    assert (list(Duel.objects.values()), list(DuelCompetitor.objects.values()), list(Entry.objects.values())) == before


def test_the_periodic_task_draws_closed_races(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    assert drive_all_on(now=race.closes_at - timedelta(seconds=1)) == 0 and not Draw.objects.exists()
    assert drive_all_on(now=race.closes_at) == 1
    assert len(driving(race)) == 1


def test_a_stuck_race_does_not_hold_up_the_next(now, monkeypatch):
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


def test_an_open_race_is_not_drawn(now):
    race = a_duel_race(now)
    with refused("duels_before_closing"):
        draw_duels(race=race, now=race.closes_at - timedelta(seconds=1))


def test_races_of_other_types_have_no_duels(now):
    race = a_race(now)
    with refused("race_has_no_duels"):
        draw_duels(race=race, now=race.closes_at)


def test_a_cancelled_race_is_never_drawn(now):
    race = a_duel_race(now)
    cancel_race(race=race, reason="Rain.", now=now)
    with refused("race_cancelled"):
        draw_duels(race=race, now=race.closes_at)
    assert drive_all_on(now=race.closes_at) == 0


def test_the_draw_waits_for_cars_sent_in_time(now, alice):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    late = submit_model(race=race, racer=alice, model=a_model(alice), now=race.closes_at - timedelta(seconds=1))
    with refused("duels_wait_for_qualifying"):
        draw_duels(race=race, now=race.closes_at)
    fail(late, UserFault("non_finite_action", step=7), race.closes_at)
    assert draw_duels(race=race, now=race.closes_at).entrants == 2


def test_only_classified_racers_still_in_the_race_are_drawn(now):
    race = a_duel_race(now, minimum_laps=3)
    qualify(race, [a_racer("car-1"), a_racer("car-2"), gone := a_racer("gone")], now)
    drive(race, a_racer("house", is_house=True), laps(9_000, 9_000, 9_000), now)
    drive(race, a_racer("slow"), [lap(1, 9_000), lap(2, 9_000), lap(3, 9_000, complete=False, percentage=50)], now)
    enter_race(race=race, racer=a_racer("idle"), now=now)
    withdraw(entry=Entry.objects.get(racer=gone), now=now)
    assert draw_duels(race=race, now=race.closes_at).entrants == 2
    assert list(Entry.objects.filter(seed__isnull=False).values_list("racer__alias", flat=True)) == ["car-1", "car-2"]


@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_only_the_best_qualifiers_are_drawn_up_to_the_limit(now, settings, format_):
    settings.DUELS_IN_ROUND_ROBIN = settings.DUELS_IN_BRACKET = 3
    race = drawn(now, 5, duel_format=format_)
    assert Draw.objects.get().entrants == 3
    assert ranking(race) == [f"car-{n}" for n in range(1, 6)], "who was not drawn stands behind, by qualifying"
    assert [row.rank for row in board(race).rows] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("entrants", [0, 1])
@pytest.mark.parametrize("format_", ["round_robin", "bracket"])
def test_a_race_of_fewer_than_two_cars_ends_with_its_draw(now, entrants, format_):
    race = drawn(now, entrants, duel_format=format_)
    assert Draw.objects.get().over_at == race.closes_at and not Duel.objects.exists()
    assert ranking(race) == ["car-1"] * entrants


def test_qualifying_is_fixed_once_duels_are_drawn(now):
    race = a_duel_race(now)
    qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
    failed = submit_model(race=race, racer=(bob := a_racer("bob")), model=a_model(bob), now=now)
    fail(failed, PlatformFault("internal_error"), now)
    draw_duels(race=race, now=race.closes_at)
    with refused("duels_drawn"):
        repeat_submission(submission=failed, now=race.closes_at)
