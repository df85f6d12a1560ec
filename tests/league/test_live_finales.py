"""The finale of a month as a live event: its field drives, what is shown decides, and the round waits for the show."""

from __future__ import annotations

from datetime import timedelta

import pytest

from league.models import ChampionshipPlace
from league.stewarding.official_results import close_due_rounds, close_round
from races.boards.selectors.board import board as board_of
from races.live.services import begin_live, choose_model, end_live, plan_live, prepare_ahead, tick_live
from races.models import LiveEvent, LiveSlot, LiveState
from tests.factories import a_model, a_racer
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers
from tests.live_shows import compute, show, slot_of
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def stella():
    return a_racer("stella", is_staff=True)


@pytest.fixture
def finale(stella):
    """The finale of January with its field of three; those who qualified best first."""
    season = a_season()
    january, field = a_round(season, 1, "pro-qualifier"), racers(5)
    board(january.race, field)
    finale = a_round(season, 1, "pro-finale")
    close_round(round=january, now=after(january))
    finale.field = field[:3]
    return finale


def test_what_is_shown_decides_who_goes_to_the_championship(finale, stella, wakes):
    race, one = finale.race, finale.field
    opens = race.opens_at
    refused("race_not_yours", plan_live, race=race, by=one[0], now=opens, starts_at=opens + HOUR)
    event = plan_live(race=race, by=stella, now=opens, starts_at=race.closes_at - timedelta(minutes=1), rounds=1)
    for racer in one:
        choose_model(event=event, racer=racer, model=a_model(racer), now=opens + HOUR)
    late = a_racer("late")
    refused("live_not_in", choose_model, event=event, racer=late, model=a_model(late), now=opens + HOUR)

    at = event.starts_at
    begin_live(event=event, by=stella, seen=None, now=at)
    assert LiveSlot.objects.filter(event=event).count() == 3, "the field and nobody else"
    for racer, lap_ms in zip(one, (10_000, 9_000, 9_500), strict=True):
        prepare_ahead(event=event, now=at)
        slot = slot_of(event, racer.alias)
        if slot.evaluation_id is None:  # only the next two are computed ahead
            LiveSlot.objects.filter(event=event, state="waiting").exclude(pk=slot.pk).update(state="held")
            prepare_ahead(event=event, now=at)
            LiveSlot.objects.filter(event=event, state="held").update(state="waiting")
        compute(slot, at, *[lap_ms] * 3)
        at = show(event, slot, stella, at)
    assert at > race.closes_at
    close_due_rounds(now=at)
    finale.refresh_from_db()
    assert finale.closed_at is None, "the round waits for the show"
    refused("round_still_driving", close_round, round=finale, now=at)

    end_live(event=event, by=stella, seen=None, now=at)
    assert event.winner.racer == one[1]
    assert [row.entry.racer for row in board_of(race, None).rows] == [one[1], one[2], one[0]]
    close_due_rounds(now=at + timedelta(minutes=5))
    finale.refresh_from_db()
    assert finale.closed_at is not None
    assert set(ChampionshipPlace.objects.values_list("racer", flat=True)) == {one[1].pk, one[2].pk}


def test_a_show_that_nobody_ends_holds_a_round_up_for_six_hours_and_no_longer(finale, stella, wakes):
    race = finale.race
    event = plan_live(race=race, by=stella, now=race.opens_at, starts_at=race.closes_at - timedelta(minutes=1))
    begin_live(event=event, by=stella, seen=None, now=event.starts_at)
    close_due_rounds(now=after(finale, hours=1))
    finale.refresh_from_db()
    assert finale.closed_at is None
    late = after(finale, hours=7)
    tick_live(now=late)
    assert LiveEvent.objects.get().state == LiveState.ENDED
    close_due_rounds(now=late)
    finale.refresh_from_db()
    assert finale.closed_at == late
