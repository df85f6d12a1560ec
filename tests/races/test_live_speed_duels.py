"""Speed commands in duels that are shown live: each racer commands their own car of the heat."""

from __future__ import annotations

from datetime import timedelta

import pytest

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from races.live.document import live_document
from races.live.selectors.speed import speed_document
from races.live.services import command_now, command_start, launch, prepare_ahead, tick_live
from races.models import LiveRacer
from tests.duels import duel_outcome
from tests.factories import a_racer, start
from tests.live_shows import tick_through
from tests.races.test_live_duels import a_live_draw, begun, compute, slots

pytestmark = pytest.mark.django_db
LEAD_S = 12  # 3 s and a twentieth of 180 s


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def heat(alice, now):
    """The first heat of two cars on track, and when it started; with each racer by the number of their car."""
    event, at = begun(a_live_draw(now, alice, 2, plan={"speed_control": True}), alice)
    compute(slots(event)[0], at)
    slot = launch(event=event, by=alice, seen=None, now=at)
    racers = [LiveRacer.objects.get(event=event, entry=entry) for entry in slots(event)[0].starting]
    return event, slot, slot.starts_at, racers


def command(event, mine, at, value, mode="multiplier"):
    slot = command_now(event=event, racer=mine, by=mine.entry.racer, mode=mode, value=value, now=at)
    slot.refresh_from_db()
    return slot


def logged(run: Evaluation):
    commands = RaceRules.from_dict(run.spec["rules"]).speed_commands
    return [(one.car, one.at_ms, one.value) for one in commands]


def test_each_commands_their_own_car_one_after_the_other(heat):
    event, slot, starts, (front, behind) = heat
    slot = command(event, behind, starts, 0.8)
    assert logged(slot.speed_run) == [(1, LEAD_S * 1000, 0.8)]
    assert [rival.model_id for rival in slot.speed_run.rivals.all()] == [behind.entry.best.evaluation.model_id]
    slot = command(event, front, starts + timedelta(seconds=1), 1.2)
    slot = command(event, behind, starts + timedelta(seconds=3), 0.9)
    slot = command(event, front, starts + timedelta(seconds=4), 1.3)
    assert [(one["car"], one["value"]) for one in slot.speed_wish] == [(1, 0.9), (0, 1.3)]
    told = speed_document(event, front, starts + timedelta(seconds=5))
    assert (told["coming"], told["wished"]["value"]) == (None, 1.3)
    assert speed_document(event, behind, starts + timedelta(seconds=5))["coming"]["value"] == 0.8

    first = compute_command(slot, starts)
    tick_live(now=starts + timedelta(seconds=6))
    slot.refresh_from_db()
    assert slot.evaluation_id == first.pk
    cars = live_document(event, starts + timedelta(seconds=LEAD_S + 1))["current"]["cars"]
    assert [None if car["speed"] is None else car["speed"]["value"] for car in cars] == [None, 0.8]
    tick_through(starts + timedelta(seconds=6), starts + timedelta(seconds=LEAD_S))
    slot.refresh_from_db()
    assert logged(slot.speed_run) == [(1, LEAD_S * 1000, 0.8), (1, 2 * LEAD_S * 1000, 0.9)]
    assert [(one["car"], one["value"]) for one in slot.speed_wish] == [(0, 1.3)], "the other's still waits"


def compute_command(slot, at) -> Evaluation:
    run = start(Evaluation.with_sealed.get(pk=slot.speed_run_id), at)
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=duel_outcome([0, 1], {}, ()), now=at)
    return run


def test_a_command_that_is_late_is_told_to_whose_it_was(heat):
    event, _slot, starts, (front, behind) = heat
    command(event, behind, starts, 0.8)
    after = starts + timedelta(seconds=LEAD_S)
    tick_live(now=after)
    assert speed_document(event, behind, after)["reason"] == "live_speed_late"
    assert speed_document(event, front, after)["reason"] == ""
    command(event, front, after, 1.1)
    assert speed_document(event, behind, after)["reason"] == "live_speed_late", "the other's command takes nothing back"


def test_a_heat_begins_as_its_racers_say(alice, now):
    event, at = begun(a_live_draw(now, alice, 2, plan={"speed_control": True}), alice)
    old = compute(slots(event)[0], at)
    second = LiveRacer.objects.get(event=event, entry=slots(event)[0].starting[1])
    command_start(event=event, racer=second, by=second.entry.racer, mode="cap", value=2.0, now=at)
    assert not Evaluation.with_sealed.filter(pk=old.pk).exists()
    prepare_ahead(event=event, now=at)
    first, swapped = slots(event)
    assert logged(first.evaluation) == [(1, 0, 2.0)]
    assert logged(swapped.evaluation) == [(0, 0, 2.0)], "it stands in front there"


def test_who_is_not_in_the_heat_commands_nothing(alice, now):
    event, at = begun(a_live_draw(now, alice, 4, plan={"speed_control": True}), alice)
    compute(slots(event)[0], at)
    slot = launch(event=event, by=alice, seen=None, now=at)
    other = LiveRacer.objects.get(event=event, entry__racer__alias="car-2")
    with pytest.raises(UserFault) as caught:
        command(event, other, slot.starts_at, 1.2)
    assert caught.value.code == "live_speed_not_driving"
