"""Live events when several do something at the same moment: on SQLite here, on PostgreSQL in tests/core."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.events import Event
from evaluation.models import Evaluation, Result
from evaluation.running.queue.jobs import EVALUATIONS
from races.live.services import choose_model, launch, prepare_ahead, skip_slot, tick_live
from races.live.services.show import reveal
from races.models import LiveLog, LiveSlot, SlotState, Submission
from tests.factories import a_model, a_racer, start
from tests.live_shows import a_show, begun, compute, racer_of, slot_of
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def alice():
    return a_racer("alice")


def test_two_organisers_at_once_do_one_thing_once(alice, now):
    stella = a_racer("stella", is_staff=True)
    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
    for name in ("bob", "carl"):
        compute(slot_of(event, name), now, 9_000)
    seen = event.version
    calls = [
        lambda who=who: launch(event=type(event).objects.get(), by=who, seen=seen, now=now).pk
        for who in (alice, stella, alice, stella)
    ]
    answers = at_once(calls)
    assert answers.count("live_changed") == 3, answers
    assert LiveSlot.objects.filter(state=SlotState.RUNNING).count() == 1
    assert LiveLog.objects.filter(action="launch").count() == 1


def test_clocks_that_reveal_at_once_reveal_once(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    launch(event=event, by=alice, seen=None, now=now)
    slot = slot_of(event, "bob")
    over = slot.ends_at + timedelta(seconds=2)
    answers = at_once([lambda: reveal(slot=slot, now=over) for _ in range(4)])
    assert sorted(answers) == [False, False, False, True], answers
    assert Submission.objects.filter(is_live=True).count() == 1
    assert Event.objects.filter(kind="race.result").count() == 1


def test_a_choice_a_launch_and_a_skip_at_once_leave_one_story(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    bob = racer_of(event, "bob").entry.racer
    other = a_model(bob)
    at_once(
        [
            lambda: launch(event=type(event).objects.get(), by=alice, seen=None, now=now) and None,
            lambda: choose_model(event=event, racer=bob, model=other, now=now) and None,
            lambda: skip_slot(
                event=type(event).objects.get(), slot=slot_of(event, "bob"), by=alice, seen=None, now=now
            ),
            lambda: prepare_ahead(event=event, now=now),
        ]
    )
    slot = slot_of(event, "bob")
    if slot.state == SlotState.RUNNING:
        assert slot.evaluation_id is not None
        assert Result.with_sealed.filter(evaluation=slot.evaluation_id).exists()
    runs = Evaluation.with_sealed.filter(sealed=True)
    assert runs.count() == runs.filter(live_slot__isnull=False).count()  # none is left over


def test_a_worker_that_is_killed_is_replaced_and_nobody_sees_anything(alice, now):
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    slot = slot_of(event, "bob")
    run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
    start(run, now)  # and then it is killed
    later = now + timedelta(minutes=5)
    EVALUATIONS.sweep(now=later)
    run.refresh_from_db()
    assert (run.state, run.sealed) == ("queued", True)
    assert not Event.objects.filter(subject=run.public_id).exists()
    Evaluation.with_sealed.filter(pk=run.pk).update(not_before=None)
    compute(slot, later, 9_000)
    launch(event=event, by=alice, seen=None, now=later)
    tick_live(now=slot_of(event, "bob").ends_at + timedelta(seconds=2))
    assert Submission.objects.get(is_live=True).evaluation.attempt == 2
