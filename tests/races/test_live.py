"""A live event: who drives when, what is sealed and revealed, what each act does once."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.events import Event
from evaluation.models import Evaluation, Result
from paddock.errors import UserFault
from races.aftermath.certificate import placed
from races.boards.selectors.board import board
from races.entries.selectors.visibility import can_see_evaluation
from races.entries.services.entries import accept_invitation
from races.live.selectors.events import can_see_live, live_standings, played
from races.live.services import (
    begin_live,
    call_slot,
    end_live,
    hold_slot,
    launch,
    move_slot,
    plan_live,
    prepare_ahead,
    remove_slot,
    run_again,
    skip_slot,
    tick_live,
    undo_last,
)
from races.models import Entry, LiveEvent, LiveLog, LiveSlot, LiveState, SlotState, Submission
from tests.factories import a_model, a_racer, drive, laps
from tests.live_shows import a_live_race, a_show, begun, compute, show, slot_of, slots
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def alice():
    return a_racer("alice")


class TestOrder:
    def test_the_slowest_qualifier_drives_first_and_who_did_not_qualify_before_them(self, alice, now):
        race = a_live_race(now, alice)
        for name, lap_ms in (("quick", 9_000), ("slow", 11_000), ("middle", 10_000)):
            drive(race, a_racer(name), laps(lap_ms), now)
        event = a_show(now, alice, ["quick", "slow", "middle", "late"], race=race, rounds=2)
        begin_live(event=event, by=alice, seen=None, now=now)
        names = [slot.racer.entry.racer.alias for slot in slots(event)]
        assert names == ["late", "slow", "middle", "quick"] * 2

    def test_who_missed_the_roll_call_is_held(self, alice, now):
        event = a_show(now, alice, ["bob"], roll_call=True)
        begin_live(event=event, by=alice, seen=None, now=now)
        (slot,) = slots(event)
        assert (slot.state, slot.reason_code) == (SlotState.HELD, "live_absent")

    def test_a_place_moves_before_another(self, alice, now):
        event = begun(a_show(now, alice, ["a1", "b2", "c3"], order="as_entered"), alice, now)
        move_slot(event=event, slot=slot_of(event, "c3"), before=slot_of(event, "a1"), by=alice, seen=None, now=now)
        assert [slot.racer.entry.racer.alias for slot in slots(event)] == ["c3", "a1", "b2"]


class TestSealed:
    def test_a_computed_run_is_known_to_nobody(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        run = compute(slot_of(event, "bob"), now, 9_000)
        bob = run.owner
        stella = a_racer("stella", is_staff=True)
        assert not Evaluation.objects.filter(pk=run.pk).exists()
        assert not Result.objects.filter(evaluation=run).exists()
        assert not any(can_see_evaluation(who, run) for who in (bob, alice, stella, None))
        assert not Submission.objects.exists()
        assert Entry.objects.get(racer=bob).best_id is None
        assert not Event.objects.filter(kind__in=["run.started", "run.finished", "race.result"]).exists()

    def test_it_is_revealed_once_when_it_was_played(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        slot = slot_of(event, "bob")
        run = compute(slot, now, 9_000, 8_500)
        launch(event=event, by=alice, seen=None, now=now)
        slot.refresh_from_db()
        assert slot.starts_at == now + timedelta(seconds=10)
        assert slot.ends_at == slot.starts_at + timedelta(milliseconds=17_500)
        assert tick_live(now=slot.ends_at) == 0
        assert not Submission.objects.exists()
        over = slot.ends_at + timedelta(seconds=2)
        tick_live(now=over)
        tick_live(now=over)
        shown = Submission.objects.get()
        assert (shown.is_live, shown.evaluation_id) == (True, run.pk)
        assert Event.objects.filter(kind="race.result").count() == 1
        assert Event.objects.filter(kind="run.finished").count() == 1
        assert can_see_evaluation(None, Evaluation.objects.get(pk=run.pk))
        assert board(event.race).rows[0].entry.score_ms == 8_500

    def test_a_live_score_stands_before_a_faster_qualifying(self, alice, now):
        race = a_live_race(now, alice)
        drive(race, a_racer("fast"), laps(7_000), now)
        event = a_show(now, alice, ["bob"], race=race)
        begun(event, alice, now)
        compute(slot_of(event, "bob"), now, 9_000)
        show(event, slot_of(event, "bob"), alice, now)
        rows = board(race).rows
        assert [(row.alias, row.rank, row.entry.is_live, row.gap_ms) for row in rows] == [
            ("bob", 1, True, 0),
            ("fast", 2, False, None),
        ]

    def test_what_is_played_is_what_has_passed(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        slot = slot_of(event, "bob")
        compute(slot, now, 9_000)
        slot.refresh_from_db()
        assert played(slot, now) == ([], False)
        launch(event=event, by=alice, seen=None, now=now)
        slot.refresh_from_db()
        assert played(slot, slot.starts_at + timedelta(milliseconds=499)) == ([], False)
        chunks, over = played(slot, slot.starts_at + timedelta(milliseconds=4_100))
        assert ([chunk["n"] for chunk in chunks], over) == (list(range(8)), False)
        assert all(t < 4_000 for chunk in chunks for car in chunk["cars"] for t in car["t"])
        assert [event["t"] for chunk in chunks for event in chunk["events"]] == [3_000]


class TestActs:
    def test_of_two_organisers_who_launch_one_does(self, alice, now):
        event = begun(a_show(now, alice, ["bob", "carl"]), alice, now)
        for name in ("bob", "carl"):
            compute(slot_of(event, name), now, 9_000)
        seen = event.version
        launch(event=event, by=alice, seen=seen, now=now)
        refused("live_changed", launch, event=event, by=alice, seen=seen, now=now)
        refused("live_busy", launch, event=event, by=alice, seen=None, now=now)
        assert LiveSlot.objects.filter(state=SlotState.RUNNING).count() == 1

    def test_what_is_not_computed_is_not_launched(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        refused("live_not_ready", launch, event=event, by=alice, seen=None, now=now)

    def test_a_stranger_does_nothing(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        mallory = a_racer("mallory")
        refused("race_not_yours", call_slot, event=event, slot=slots(event)[0], by=mallory, seen=None, now=now)
        assert not LiveLog.objects.filter(by=mallory).exists()

    def test_an_act_is_undone_for_two_minutes(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        skip_slot(event=event, slot=slots(event)[0], by=alice, seen=None, now=now)
        refused(
            "live_undo_late", undo_last, event=event, by=alice, seen=None, now=now + timedelta(minutes=2, seconds=1)
        )
        undo_last(event=event, by=alice, seen=None, now=now + timedelta(minutes=2))
        assert slots(event)[0].state == SlotState.WAITING

    def test_a_launch_is_undone_in_its_countdown_and_not_later(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        compute(slot_of(event, "bob"), now, 9_000)
        launch(event=event, by=alice, seen=None, now=now)
        refused("live_undo_late", undo_last, event=event, by=alice, seen=None, now=now + timedelta(seconds=10))
        undo_last(event=event, by=alice, seen=None, now=now + timedelta(seconds=9))
        slot = slot_of(event, "bob")
        assert (slot.state, slot.starts_at, slot.ends_at) == (SlotState.WAITING, None, None)

    def test_a_race_has_one_live_event(self, alice, now):
        event = a_show(now, alice, [])
        refused("live_exists", plan_live, race=event.race, by=alice, now=now, starts_at=now + timedelta(days=1))

    def test_one_more_attempt_comes_next(self, alice, now):
        event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
        compute(slot_of(event, "bob"), now, 9_000)
        over = show(event, slot_of(event, "bob"), alice, now)
        run_again(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=over)
        assert [(slot.racer.entry.racer.alias, slot.attempt) for slot in slots(event)] == [
            ("bob", 1),
            ("bob", 2),
            ("carl", 1),
        ]


class TestEnd:
    def test_the_best_has_won(self, alice, now):
        event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
        for name, lap_ms in (("bob", 9_000), ("carl", 8_000)):
            compute(slot_of(event, name), now, lap_ms)
            now = show(event, slot_of(event, name), alice, now)
        assert [(row.rank, row.racer.entry.racer.alias, row.gap_ms) for row in live_standings(event)] == [
            (1, "carl", 0),
            (2, "bob", 1_000),
        ]
        end_live(event=event, by=alice, seen=None, now=now)
        assert event.winner.racer.alias == "carl"

    def test_what_was_computed_and_never_shown_is_thrown_away(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        compute(slot_of(event, "bob"), now, 9_000)
        end_live(event=event, by=alice, seen=None, now=now)
        tick_live(now=now + timedelta(minutes=1))
        assert Evaluation.with_sealed.exists()
        tick_live(now=now + timedelta(minutes=3))
        assert not Evaluation.with_sealed.exists()

    def test_one_that_nobody_ends_ends_by_itself(self, alice, now):
        event = begun(a_show(now, alice, ["bob"]), alice, now)
        tick_live(now=now + timedelta(hours=7))
        event.refresh_from_db()
        assert event.state == LiveState.ENDED

    def test_an_organiser_who_leaves_takes_no_run_along(self, alice, now):
        event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
        compute(slot_of(event, "bob"), now, 9_000)
        launch(event=event, by=alice, seen=None, now=now)
        alice.delete()
        slot = slot_of(event, "bob")
        tick_live(now=slot.ends_at + timedelta(seconds=3))
        assert Submission.objects.filter(is_live=True).count() == 1
        event = LiveEvent.objects.get()
        with pytest.raises(UserFault) as caught:
            end_live(event=event, by=a_racer("eve"), seen=None, now=slot.ends_at + timedelta(minutes=1))
        assert caught.value.code == "race_not_yours"
        staff = a_racer("stella", is_staff=True)
        compute(slot_of(event, "carl"), slot.ends_at + timedelta(minutes=1), 9_500)
        launch(event=event, by=staff, seen=None, now=slot.ends_at + timedelta(minutes=2))
        tick_live(now=slot_of(event, "carl").ends_at + timedelta(seconds=3))
        tick_live(now=slot.ends_at + timedelta(hours=7))
        event.refresh_from_db()
        assert (event.state, event.winner.racer.alias) == (LiveState.ENDED, "bob")

    def test_one_that_nobody_begins_is_called_off(self, alice, now):
        event = a_show(now, alice, ["bob"])
        tick_live(now=event.starts_at + timedelta(hours=7))
        event.refresh_from_db()
        assert event.state == LiveState.CANCELLED


def test_a_communitys_final_is_shown_once_its_race_has_closed(alice, now):
    """Its members qualify as long as it is open; the best two of them meet live, and what is shown decides."""
    race = a_live_race(now, alice, visibility="invitation", closes_at=now + timedelta(days=1))
    for name, lap_ms in (("bob", 9_000), ("carl", 9_500), ("dora", 11_000)):
        accept_invitation(token=race.invitation, racer=(racer := a_racer(name)), now=now)
        drive(race, racer, laps(lap_ms), now)
    at = race.closes_at + timedelta(hours=1)
    event = plan_live(race=race, by=alice, now=now, starts_at=at, rounds=1)
    begin_live(event=event, by=alice, seen=None, now=at)
    assert [slot.racer.entry.racer.alias for slot in slots(event)] == ["dora", "carl", "bob"]
    remove_slot(event=event, slot=slot_of(event, "dora"), by=alice, seen=None, now=at)
    prepare_ahead(event=event, now=at)
    for name, lap_ms in (("carl", 8_800), ("bob", 8_900)):
        compute(slot_of(event, name), at, lap_ms)
        at = show(event, slot_of(event, name), alice, at)
    end_live(event=event, by=alice, seen=None, now=at)
    assert event.winner.racer.alias == "carl"
    rows = board(race, alice).rows
    assert [(row.alias, row.rank, row.entry.score_ms) for row in rows] == [
        ("carl", 1, 8_800),
        ("bob", 2, 8_900),
        ("dora", 3, 11_000),
    ]
    told = placed(race, Entry.objects.get(race=race, racer__alias="carl"), at)
    assert (told.rank, told.of) == (1, 2)
    assert not can_see_live(a_racer("mallory"), event) and not can_see_live(None, event)


class TestByItself:
    def test_it_begins_calls_launches_and_ends_without_anybody(self, alice, now):
        event = a_show(now, alice, ["bob", "carl"], auto_run=True, gap_s=20)
        tick_live(now=event.starts_at - timedelta(seconds=1))
        event.refresh_from_db()
        assert event.state == LiveState.PLANNED
        at = event.starts_at
        for _ in range(60):
            tick_live(now=at)
            for slot in LiveSlot.objects.filter(evaluation__state="queued"):
                compute(slot, at, 9_000 + slot.pk)
            at += timedelta(seconds=5)
        event.refresh_from_db()
        assert event.state == LiveState.ENDED
        assert {slot.state for slot in slots(event)} == {SlotState.DONE}
        assert Submission.objects.filter(is_live=True).count() == 2

    def test_who_has_deleted_their_model_is_held_and_the_next_drives(self, alice, now):
        from evaluation.garage.services import delete_model

        event = a_show(now, alice, ["bob", "carl"], auto_run=True, order="as_entered", gap_s=0)
        delete_model(model=slot_model(event, "bob"), now=now)
        begun(event, alice, event.starts_at)
        at = event.starts_at + timedelta(seconds=1)
        tick_live(now=at)
        assert (slot_of(event, "bob").state, slot_of(event, "bob").reason_code) == (SlotState.HELD, "live_no_model")
        compute(slot_of(event, "carl"), at, 9_000)
        tick_live(now=at)
        assert slot_of(event, "carl").state == SlotState.RUNNING


def slot_model(event, alias):
    from tests.live_shows import racer_of

    return racer_of(event, alias).model


def test_a_model_deleted_after_it_was_computed_drives_all_the_same(alice, now):
    from evaluation.garage.services import delete_model

    event = begun(a_show(now, alice, ["bob"]), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    delete_model(model=slot_model(event, "bob"), now=now)
    show(event, slot_of(event, "bob"), alice, now)
    assert slot_of(event, "bob").state == SlotState.DONE
    assert Entry.objects.get(racer__alias="bob").score_ms == 9_000


@pytest.mark.parametrize("computed", [True, False])
def test_a_model_deleted_between_call_and_launch_drives_all_the_same(alice, now, computed):
    """Its run is computed, or has been asked for: the racer was called with this car."""
    from evaluation.garage.services import delete_model

    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
    if computed:
        compute(slot_of(event, "bob"), now, 9_000)
    call_slot(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    delete_model(model=slot_model(event, "bob"), now=now)
    tick_live(now=now)
    if not computed:
        refused("live_not_ready", launch, event=event, by=alice, seen=None, now=now)
        compute(slot_of(event, "bob"), now, 9_000)
    show(event, slot_of(event, "bob"), alice, now)
    assert slot_of(event, "bob").state == SlotState.DONE
    assert Entry.objects.get(racer__alias="bob").score_ms == 9_000


def test_another_model_throws_away_what_was_computed(alice, now):
    from races.live.services import choose_model

    event = begun(a_show(now, alice, ["bob"]), alice, now)
    old = compute(slot_of(event, "bob"), now, 9_000)
    bob = old.owner
    choose_model(event=event, racer=bob, model=a_model(bob), now=now)
    assert not Evaluation.with_sealed.filter(pk=old.pk).exists()
    call_slot(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    refused("live_called", choose_model, event=event, racer=bob, model=a_model(bob), now=now)


def test_what_is_held_is_not_next(alice, now):
    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
    for name in ("bob", "carl"):
        compute(slot_of(event, name), now, 9_000)
    hold_slot(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    launch(event=event, by=alice, seen=None, now=now)
    assert slot_of(event, "carl").state == SlotState.RUNNING
