"""A live event that begins while cars of its racers are still in the queue."""

from __future__ import annotations

from datetime import timedelta

import pytest

from evaluation.models import State
from paddock.errors import UserFault
from races.entries.services.entries import enter_race
from races.entries.services.submissions import submit_model
from races.live.services import begin_live, hold_slot, launch, plan_live, prepare_ahead, tick_live
from races.models import LiveState, SlotState
from tests.factories import a_model, a_racer, fail, finish, laps
from tests.live_shows import START, a_live_race, compute, racer_of, slot_of

pytestmark = pytest.mark.django_db
SECOND = timedelta(seconds=1)


@pytest.fixture
def alice():
    return a_racer("alice")


def queued(now, alice, *names, auto=True):
    """An event under way whose racers have cars in the queue, and their submissions by name."""
    race = a_live_race(now, alice)
    sent = {}
    for name in names:
        enter_race(race=race, racer=(racer := a_racer(name)), now=now)
        sent[name] = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
    event = plan_live(
        race=race, by=alice, now=now, starts_at=now + START, rounds=1, order="as_entered", auto_run=auto, gap_s=0
    )
    begin_live(event=event, by=alice, seen=None, now=now)
    return event, sent


def ticks(now, times=4):
    for _ in range(times):
        now += SECOND
        tick_live(now=now)
    return now


def state(event, name):
    slot = slot_of(event, name)
    return slot.state, slot.reason_code


def test_a_queued_car_is_waited_for_and_released_by_itself(alice, now):
    event, sent = queued(now, alice, "bob", "carl")
    now = ticks(now + START)
    assert state(event, "bob") == state(event, "carl") == (SlotState.HELD, "live_car_queued")
    finish(sent["carl"], laps(9_000), now)
    now = ticks(now)
    assert state(event, "carl")[0] == SlotState.WAITING
    compute(slot_of(event, "carl"), now, 9_000)
    now = ticks(now, 1)
    assert state(event, "carl")[0] == SlotState.RUNNING
    assert state(event, "bob") == (SlotState.HELD, "live_car_queued")
    finish(sent["bob"], laps(8_000), now)
    now = ticks(now, 1)
    assert state(event, "bob")[0] == SlotState.WAITING, "while the other car is on track"
    prepare_ahead(event=event, now=now)
    assert slot_of(event, "bob").evaluation_id
    assert racer_of(event, "bob").qualified_ms == 8_000


def test_an_event_does_not_end_before_its_queue(alice, now):
    event, sent = queued(now, alice, "bob")
    now = ticks(now + START + timedelta(minutes=10)) + timedelta(minutes=30)
    now = ticks(now)
    event.refresh_from_db()
    assert event.state == LiveState.RUNNING
    finish(sent["bob"], laps(9_000), now)
    ticks(now)
    assert state(event, "bob")[0] == SlotState.WAITING


def test_a_car_that_fails_in_the_queue_is_no_car(alice, now):
    event, sent = queued(now, alice, "bob")
    now = ticks(now + START)
    fail(sent["bob"], UserFault("non_finite_action", step=7), now)
    now = ticks(now)
    assert state(event, "bob") == (SlotState.HELD, "live_no_model")
    ticks(now + timedelta(minutes=10))
    event.refresh_from_db()
    assert event.state == LiveState.ENDED


def test_by_hand_a_queued_car_says_so_and_others_are_computed(alice, now):
    event, sent = queued(now, alice, "a1", "b2", "c3", auto=False)
    finish(sent["c3"], laps(9_000), now)
    now = ticks(now + START)
    assert state(event, "a1") == (SlotState.WAITING, "live_car_queued")
    assert slot_of(event, "c3").evaluation.state == State.QUEUED
    with pytest.raises(UserFault) as fault:
        launch(event=event, by=alice, seen=None, now=now, slot=slot_of(event, "a1"))
    assert fault.value.code == "live_car_queued"


def test_a_slot_that_an_organiser_holds_stays_held(alice, now):
    event, sent = queued(now, alice, "bob", auto=False)
    hold_slot(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    finish(sent["bob"], laps(9_000), now)
    ticks(now)
    assert state(event, "bob") == (SlotState.HELD, "")
