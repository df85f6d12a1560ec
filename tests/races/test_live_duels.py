"""Duels in a live event: heats are sealed places of the running order, and nothing of them is known until shown."""

from __future__ import annotations

import io
from datetime import datetime, timedelta

import pytest
from django.urls import reverse
from PIL import Image

from core.events import Event
from evaluation.garage.quotas import _traces
from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import UserFault
from races.duels.selectors import duels_of
from races.duels.services import drive_all_on
from races.entries.services.entries import remove_entry
from races.live.api import poses_document
from races.live.commentary import story_of
from races.live.document import live_document
from races.live.selectors.events import console_rows
from races.live.services import (
    add_late,
    begin_live,
    cancel_live,
    choose_model,
    crown,
    end_live,
    hold_slot,
    launch,
    plan_live,
    prepare_ahead,
    release_slot,
    remove_slot,
    run_again,
    skip_slot,
    tick_live,
    undo_last,
)
from races.live.streaming.camera import frames_of
from races.models import Draw, Duel, DuelCompetitor, DuelState, Entry, LiveEvent, LiveSlot, LiveState, SlotState
from tests.clients import logged_in
from tests.duels import a_duel_race, duel_outcome, qualify
from tests.factories import a_model, a_racer, break_down, start
from tests.live_shows import slots
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def alice():
    return a_racer("alice")


def a_live_draw(now: datetime, organiser, entrants: int, *, plan=None, **fields) -> LiveEvent:
    """An event of duels among ``car-1`` (who qualified best) and so on, which has begun after its race closed."""
    race = a_duel_race(now, organiser=organiser, **({"duel_format": "bracket"} | fields))
    qualify(race, [a_racer(f"car-{number}") for number in range(1, entrants + 1)], now)
    event = plan_live(race=race, by=organiser, now=now, starts_at=race.closes_at + timedelta(hours=1), **(plan or {}))
    return event


def begun(event: LiveEvent, by) -> tuple[LiveEvent, datetime]:
    begin_live(event=event, by=by, seen=None, now=event.starts_at)
    prepare_ahead(event=event, now=event.starts_at)
    return event, event.starts_at


def cars(slot: LiveSlot) -> list[int]:
    return [entry.seed for entry in slot.entries]


def compute(slot: LiveSlot, now: datetime, choose=min, times=None) -> Evaluation:
    """Let a sealed heat be driven; ``choose`` picks its winner among the seeds."""
    slot.refresh_from_db()
    grid = [entry.seed for entry in slot.starting]
    run = start(Evaluation.with_sealed.get(pk=slot.evaluation_id, sealed=True, state=State.QUEUED), now)
    order = sorted(range(len(grid)), key=lambda number: grid[number] != choose(grid))
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=duel_outcome(order, times or {}, ()), now=now)
    return run


def show_next(event: LiveEvent, by, now: datetime, choose=min) -> datetime:
    """Compute, launch and reveal what is next; returns when."""
    prepare_ahead(event=event, now=now)
    slot = next(one for one in slots(event) if one.state == SlotState.WAITING)
    if slot.evaluation.state == State.QUEUED:
        compute(slot, now, choose)
    slot = launch(event=event, by=by, seen=None, now=now, slot=slot)
    over = slot.ends_at + timedelta(seconds=3)
    tick_live(now=over)
    prepare_ahead(event=event, now=over)
    return over


class TestBracket:
    def test_four_drive_semi_finals_and_a_final_in_that_order(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4), alice)
        assert [(slot.round, slot.duel.number, cars(slot)) for slot in slots(event)] == [
            (1, 1, [1, 4]),
            (1, 2, [4, 1]),
            (1, 3, [2, 3]),
            (1, 4, [3, 2]),
        ]
        for _ in range(3):
            at = show_next(event, alice, at, max)
        assert {slot.round for slot in slots(event)} == {1}, "who meets in the final is not known"
        at = show_next(event, alice, at, max)
        assert [cars(slot) for slot in slots(event) if slot.round == 2] == [[3, 4], [4, 3]]
        for _ in range(2):
            at = show_next(event, alice, at, max)
        assert Draw.objects.get(race=event.race).over_at == at
        end_live(event=event, by=alice, seen=None, now=at)
        told = live_document(event, at)
        assert (told["winner"], told["podium"]) == ("car-4", ["car-4", "car-3", "car-1"])
        assert Event.objects.filter(kind="duel.decided").count() == 6

    def test_who_has_a_bye_is_told_and_meets_who_won(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 3), alice)
        assert [cars(slot) for slot in slots(event)] == [[2, 3], [3, 2]]
        first = live_document(event, at)["bracket"][0]["ties"][0]
        assert (first["bye"], [car["racer"] for car in first["cars"]]) == (True, ["car-1"])
        for _ in range(2):
            at = show_next(event, alice, at)
        assert [cars(slot) for slot in slots(event) if slot.round == 2] == [[1, 2], [2, 1]]

    @pytest.mark.slow
    def test_eight_run_by_themselves_from_the_lobby_to_the_podium(self, alice, now):
        event = a_live_draw(now, alice, 8, plan={"auto_run": True, "gap_s": 5})
        at = event.starts_at
        for _ in range(100):
            tick_live(now=at)
            for slot in LiveSlot.objects.filter(evaluation__state="queued"):
                compute(slot, at)
            event.refresh_from_db()
            if event.is_over:
                break
            at += timedelta(seconds=50)
        assert event.state == LiveState.ENDED
        assert event.winner.racer.alias == "car-1"
        assert Duel.objects.filter(state=DuelState.DECIDED).count() == 14
        assert not Evaluation.objects.filter(sealed=True).exists()

    def test_the_best_of_three_drives_a_third_where_both_have_won(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4, duel_heats=3), alice)
        assert [slot.duel.number for slot in slots(event)] == [1, 2, 4, 5]
        for _ in range(4):
            at = show_next(event, alice, at, lambda grid: grid[0] if 1 in grid else 3)
        assert [(slot.round, slot.duel.number, cars(slot)) for slot in slots(event)[4:]] == [(1, 3, [1, 4])]
        told = live_document(event, at)["bracket"][0]["ties"]
        assert [[car["points"] for car in tie["cars"]] for tie in told] == [[1, 1], [0, 2]]
        assert [car["won"] for car in told[0]["cars"]] == [False, False]
        assert (duels_of(event.race).decided, duels_of(event.race).total) == (4, 7)
        at = show_next(event, alice, at, max)
        assert [cars(slot) for slot in slots(event)[5:]] == [[3, 4], [4, 3]]
        for _ in range(2):
            at = show_next(event, alice, at)
        assert Draw.objects.get(race=event.race).over_at == at
        end_live(event=event, by=alice, seen=None, now=at)
        assert live_document(event, at)["winner"] == "car-3"

    def test_one_heat_may_decide_a_tie(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4, duel_heats=1), alice)
        for _ in range(3):
            at = show_next(event, alice, at, max)
        assert [(slot.round, cars(slot)) for slot in slots(event)] == [(1, [1, 4]), (1, [2, 3]), (2, [3, 4])]
        assert Draw.objects.get(race=event.race).over_at == at

    def test_a_round_robin_is_shown_too(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 3, duel_format="round_robin"), alice)
        assert len(slots(event)) == 6
        for _ in range(6):
            at = show_next(event, alice, at)
        end_live(event=event, by=alice, seen=None, now=at)
        assert event.winner.racer.alias == "car-1"


class TestStory:
    def test_a_heat_is_told_once_it_was_seen(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 2), alice)
        assert story_of(event, at) == []
        compute(slots(event)[0], at)
        slot = launch(event=event, by=alice, seen=None, now=at)
        told = [each.text for each in story_of(event, slot.starts_at + timedelta(seconds=11.4))]
        assert told == ["car-1 – car-2 are on track, round 1."]
        told = [each.text for each in story_of(event, slot.starts_at + timedelta(seconds=13))]
        assert "car-1: lap 1 in 10.000 s." in told
        assert not any("wins" in text for text in told)
        over = slot.ends_at + timedelta(seconds=3)
        tick_live(now=over)
        assert "car-1 wins the heat, before car-2." in [each.text for each in story_of(event, over)]
        assert not any("final" in each.text for each in story_of(event, over)), "one of two heats"
        over = show_next(event, alice, over)
        assert story_of(event, over)[0].text == "car-1 has won the final against car-2."
        assert "car-2 – car-1 are on track, round 1." in [each.text for each in story_of(event, over)]


class TestSealed:
    def test_a_computed_heat_is_known_to_nobody(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4), alice)
        before = (live_document(event, at)["bracket"], live_document(event, at)["standings"])
        kept = [list(rows) for rows in _traces(None)]
        for slot in slots(event)[:2]:
            compute(slot, at, max)
        prepare_ahead(event=event, now=at)
        drive_all_on(now=at)
        assert set(Duel.objects.values_list("state", "evaluation", "tries")) == {(DuelState.WAITING, None, 0)}
        assert not DuelCompetitor.objects.filter(place__isnull=False).exists()
        assert (live_document(event, at)["bracket"], live_document(event, at)["standings"]) == before
        assert not Event.objects.filter(kind="duel.decided").exists()
        assert [list(rows) for rows in _traces(None)] == kept, "how large a trace is tells how long it drove"
        assert duels_of(event.race).decided == 0
        assert not Result.objects.filter(evaluation__live_slot__isnull=False).exists()

    def test_it_is_decided_when_it_was_played_and_once(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 2), alice)
        run = compute(slots(event)[0], at, max)
        slot = launch(event=event, by=alice, seen=None, now=at)
        tick_live(now=slot.ends_at + timedelta(seconds=1))
        assert not Duel.objects.exclude(state=DuelState.WAITING).exists()
        over = slot.ends_at + timedelta(seconds=2)
        tick_live(now=over)
        tick_live(now=over)
        duel = Duel.objects.get(number=1)
        assert (duel.state, duel.evaluation_id, duel.decided_at) == (DuelState.DECIDED, run.pk, over)
        told = live_document(event, over)
        assert told["order"][0]["evaluation"] == run.public_id
        assert [car["racer"] for car in told["order"][0]["cars"]] == ["car-1", "car-2"]
        assert [car["racer"] for car in told["bracket"][0]["heats"][0]["cars"]] == ["car-2", "car-1"]
        assert Event.objects.filter(kind="duel.decided").count() == 1
        assert Entry.objects.get(racer__alias="car-2").duels == 1

    def test_nobody_else_drives_its_heats(self, alice, now):
        event = a_live_draw(now, alice, 4)
        assert drive_all_on(now=event.race.closes_at) == 0
        assert Draw.objects.filter(race=event.race).exists()
        assert not Evaluation.with_sealed.filter(rivals__isnull=False).exists()
        begun(event, alice)
        assert drive_all_on(now=event.starts_at) == 0
        assert Evaluation.with_sealed.filter(rivals__isnull=False, sealed=True).count() == 2


class TestActs:
    def test_the_draw_decides_who_meets(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4), alice)
        slot = slots(event)[0]
        refused("live_drawn", remove_slot, event=event, slot=slot, by=alice, seen=None, now=at)
        late = Entry.objects.get(racer__alias="car-1")
        refused("live_drawn", add_late, event=event, entry=late, by=alice, seen=None, now=at)
        assert console_rows(event, at)[0].may == {"call", "skip", "hold", "move"}
        at = show_next(event, alice, at)
        refused("live_drawn", run_again, event=event, slot=slot, by=alice, seen=None, now=at)
        assert console_rows(event, at)[0].may == set()

    def test_a_skipped_heat_is_run_after_all(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4), alice)
        first, second = slots(event)[:2]
        skip_slot(event=event, slot=first, by=alice, seen=None, now=at)
        at = show_next(event, alice, at)
        run_again(event=event, slot=first, by=alice, seen=None, now=at)
        assert [slot.pk for slot in slots(event)][:2] == [second.pk, first.pk]
        hold_slot(event=event, slot=first, by=alice, seen=None, now=at)
        release_slot(event=event, slot=first, by=alice, seen=None, now=at)
        show_next(event, alice, at)
        assert set(Duel.objects.filter(number__in=(1, 2)).values_list("state", flat=True)) == {DuelState.DECIDED}

    def test_who_has_left_is_not_driven_against(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 4), alice)
        compute(slots(event)[0], at)
        remove_entry(entry=Entry.objects.get(racer__alias="car-4"), by=alice, now=at)
        prepare_ahead(event=event, now=at)
        told = live_document(event, at)
        assert [(slot["state"], slot["reason"]) for slot in told["order"][:2]] == [("done", "live_walkover")] * 2
        assert told["bracket"][0]["ties"][0]["cars"][0] == {"racer": "car-1", "seed": 1, "points": 2, "won": True}

    def test_another_model_has_the_heat_computed_anew(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 2), alice)
        old = compute(slots(event)[0], at)
        racer = Entry.objects.get(racer__alias="car-2").racer
        model = a_model(racer)
        choose_model(event=event, racer=racer, model=model, now=at)
        assert not Evaluation.with_sealed.filter(pk=old.pk).exists()
        prepare_ahead(event=event, now=at)
        assert slots(event)[0].evaluation.rivals.get().model == model

    def test_a_failed_heat_is_void_once_it_was_shown(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 2), alice)
        break_down(Evaluation.with_sealed.get(pk=slots(event)[0].evaluation_id), UserFault("non_finite_action"), at)
        slot = launch(event=event, by=alice, seen=None, now=at)
        tick_live(now=slot.ends_at + timedelta(seconds=3))
        assert Duel.objects.get(number=1).state == DuelState.VOID


class TestPlan:
    def test_it_begins_after_the_draw(self, alice, now):
        race = a_duel_race(now, organiser=alice, duel_format="bracket")
        soon = race.closes_at - timedelta(minutes=1)
        refused("live_before_draw", plan_live, race=race, by=alice, now=now, starts_at=soon)
        event = a_live_draw(now, alice, 2)
        refused("duels_before_closing", begin_live, event=event, by=alice, seen=None, now=now)
        assert LiveEvent.objects.get().state == LiveState.PLANNED

    def test_duels_that_are_driven_are_not_shown(self, alice, now):
        race = a_duel_race(now, organiser=alice, duel_format="bracket")
        qualify(race, [a_racer("car-1"), a_racer("car-2")], now)
        drive_all_on(now=race.closes_at)
        later = race.closes_at + timedelta(hours=1)
        refused("live_with_duels", plan_live, race=race, by=alice, now=race.closes_at, starts_at=later)

    def test_fewer_than_two_show_nothing(self, alice, now):
        event = a_live_draw(now, alice, 1)
        refused("live_nobody", begin_live, event=event, by=alice, seen=None, now=event.starts_at)

    def test_what_is_left_is_driven_as_ever_once_it_is_over(self, alice, now):
        event, at = begun(a_live_draw(now, alice, 2), alice)
        compute(slots(event)[0], at)
        end_live(event=event, by=alice, seen=None, now=at)
        assert event.winner is None
        assert drive_all_on(now=at + timedelta(minutes=2)) == 0, "the end may be undone"
        undo_last(event=event, by=alice, seen=None, now=at + timedelta(minutes=1))
        end_live(event=event, by=alice, seen=None, now=at)
        later = at + timedelta(minutes=3)
        tick_live(now=later)
        assert drive_all_on(now=later) == 2
        assert not Evaluation.with_sealed.filter(sealed=True).exists()

    def test_one_that_is_called_off_leaves_the_duels_to_themselves(self, alice, now):
        event = a_live_draw(now, alice, 2)
        cancel_live(event=event, by=alice, seen=None, now=now)
        assert drive_all_on(now=event.race.closes_at) == 2


def test_both_cars_are_played(alice, now, monkeypatch):
    from django.utils import timezone

    event, at = begun(a_live_draw(now, alice, 2), alice)
    compute(slots(event)[0], at)
    slot = launch(event=event, by=alice, seen=None, now=at)
    monkeypatch.setattr(timezone, "now", lambda: slot.starts_at + timedelta(seconds=4))
    (first, *_rest) = poses_document(slot, -1)["chunks"]
    assert [car["number"] for car in first["cars"]] == [0, 1]
    assert all(car["x"] for car in first["cars"])
    picture = Image.open(io.BytesIO(frames_of(slot, timezone.now(), 0)))
    assert picture.height == 2 * 120, "what each of them sees"
    assert frames_of(slot, timezone.now(), 8) is None


def test_an_event_that_ends_before_its_last_duel_has_no_podium_and_nobody_next(now, alice, wakes):
    event, at = begun(a_live_draw(now, alice, 4), alice)
    first = slots(event)[0]
    compute(first, at)
    launch(event=event, by=alice, seen=None, now=at)
    first.refresh_from_db()
    at = first.ends_at + timedelta(seconds=5)
    tick_live(now=at)
    page = logged_in(None).get(reverse("live_event", args=[event.race.slug])).content.decode()
    assert ">Points</th>" in page and ">Best lap</th>" not in page.partition('id="live-standings"')[2]
    assert live_document(event, at)["next"]
    event.refresh_from_db()
    end_live(event=event, by=alice, seen=None, now=at)
    told = live_document(event, at)
    assert (told["podium"], told["winner"], told["next"]) == ([], None, [])
    crown(event=event, entry=first.starting[0], by=alice, seen=None, now=at)
    assert live_document(event, at)["podium"][0] == first.starting[0].racer.alias
