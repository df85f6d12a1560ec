"""Live events that tests plan, and runs of them that drive laps of the test's choice."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from accounts.models import Racer
from evaluation.models import Evaluation, State
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.entries import enter_race
from races.live.services import begin_live, choose_model, end_live, launch, plan_live, prepare_ahead, tick_live
from races.models import LiveEvent, LiveRacer, LiveSlot, Race
from tests.factories import a_model, a_race, a_racer, laps, outcome, start

START = timedelta(hours=2)
FIELDS = {"ranking_method": "best", "minimum_laps": 1}


def a_live_race(now: datetime, organiser: Racer, **fields: Any) -> Race:
    """An open race whose board is by the best lap."""
    return a_race(now, organiser=organiser, **(FIELDS | fields))


def a_show(
    now: datetime, organiser: Racer, names: Sequence[str], *, race: Race | None = None, **plan: Any
) -> LiveEvent:
    """A planned event of a race with these racers, each with a model of their choice."""
    race = race or a_live_race(now, organiser)
    event = plan_live(race=race, by=organiser, now=now, starts_at=now + START, **({"rounds": 1} | plan))
    for name in names:
        racer = Racer.objects.filter(alias=name).first() or a_racer(name)
        enter_race(race=race, racer=racer, now=now)
        choose_model(event=event, racer=racer, model=a_model(racer), now=now)
    return event


def begun(event: LiveEvent, by: Racer, now: datetime) -> LiveEvent:
    """The event under way, its first runs queued."""
    begin_live(event=event, by=by, seen=None, now=now)
    prepare_ahead(event=event, now=now)
    return event


def slots(event: LiveEvent) -> list[LiveSlot]:
    """The running order."""
    return list(LiveSlot.objects.filter(event=event).order_by("position", "pk").select_related("evaluation"))


def slot_of(event: LiveEvent, alias: str, round_: int = 1) -> LiveSlot:
    return LiveSlot.objects.get(event=event, racer__entry__racer__alias=alias, round=round_, attempt=1)


def racer_of(event: LiveEvent, alias: str) -> LiveRacer:
    return LiveRacer.objects.get(event=event, entry__racer__alias=alias)


def compute(slot: LiveSlot, now: datetime, *times: int) -> Evaluation:
    """Let a slot's sealed run drive complete laps of these times."""
    slot.refresh_from_db()
    run = Evaluation.with_sealed.get(pk=slot.evaluation_id)
    assert run.sealed
    assert run.state == State.QUEUED
    start(run, now)
    driven = laps(*times)
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome(driven), now=now)
    run.refresh_from_db()
    return run


def tick_through(since: datetime, until: datetime) -> None:
    """Let the clock look every few seconds: a longer pause while a run is played would be an outage of the site."""
    at = since
    while at < until:
        at = min(at + timedelta(seconds=4), until)
        tick_live(now=at)


def show(event: LiveEvent, slot: LiveSlot, by: Racer, now: datetime) -> datetime:
    """Launch a computed run and play it to its end; returns when it was revealed."""
    launch(event=event, slot=slot, by=by, seen=None, now=now)
    slot.refresh_from_db()
    assert slot.ends_at is not None
    over = slot.ends_at + timedelta(seconds=3)
    tick_live(now=over)
    slot.refresh_from_db()
    return over


def an_ended_show(
    now: datetime,
    alice: Racer,
    *,
    laps: dict[str, tuple[int, ...]] | None = None,
    race: Race | None = None,
    end: bool = True,
) -> LiveEvent:
    """An event that was driven and, unless told otherwise, ended: carl before dora and bob, who led first."""
    laps = laps or {"bob": (9_000, 9_400), "carl": (8_000,), "dora": (8_500, 10_000, 8_700)}
    event = begun(a_show(now, alice, list(laps), order="as_entered", race=race), alice, now)
    for name, times in laps.items():
        prepare_ahead(event=event, now=now)
        compute(slot_of(event, name), now, *times)
        now = show(event, slot_of(event, name), alice, now)
        event.refresh_from_db()
    if end:
        end_live(event=event, by=alice, seen=event.version, now=now)
        event.refresh_from_db()
    return event
