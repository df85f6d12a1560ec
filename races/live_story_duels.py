"""The heats of a live event in sentences: who passes whom, who wins a heat, who goes on. Nothing before it was seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import Any

from django.utils.translation import gettext as _

from .duels.bracket import tie_of
from .models import COUNTDOWN, PLAYED_BEHIND, DuelFormat, LiveEvent, LiveSlot, Race, SlotState
from .replay import SECTORS
from .selectors.duels import Duels, TreeTie, duels_of
from .selectors.live import on_track, played
from .story_words import TRACED, Sentence, incident, seconds


def heats_told(event: LiveEvent, order: Sequence[LiveSlot], now: datetime) -> Iterator[Sentence]:
    """Of all heats of the running order what was seen by ``now``, each in the order in which it happened."""
    shown = sorted((slot for slot in order if slot.state == SlotState.DONE), key=lambda slot: slot.done_at or now)
    duels = duels_of(event.race)
    traced = {slot.pk for slot in shown[-TRACED:]}
    for slot in shown:
        if slot.pk in traced and slot.starts_at is not None:
            yield from _driven(slot, list(_happened(slot, now)))
        yield from reversed(list(_outcome(event, slot, duels, now)))  # the latest first: at one moment, too
    playing = on_track(order)
    if playing is None or playing.starts_at is None:
        return
    if now < playing.starts_at + PLAYED_BEHIND:
        called = min(now, playing.starts_at - COUNTDOWN)
        yield Sentence(called, "start", _("%(racers)s are about to start.") % {"racers": playing.who})
    else:
        yield from _driven(playing, list(_happened(playing, now)))


def _happened(slot: LiveSlot, now: datetime) -> Iterator[dict[str, Any]]:
    after = -1
    while True:
        chunks, _over = played(slot, now, after=after)
        for chunk in chunks:
            yield from chunk["events"]
        if not chunks:
            return
        after = chunks[-1]["n"]


def _driven(slot: LiveSlot, happened: Sequence[dict[str, Any]]) -> Iterator[Sentence]:
    assert slot.starts_at is not None
    begun = slot.starts_at + PLAYED_BEHIND
    words = _("%(racers)s are on track, round %(round)s.")
    yield Sentence(begun, "start", words % {"racers": slot.who, "round": slot.round})
    names = dict(enumerate(entry.racer.alias for entry in slot.starting))
    reached: dict[int, int] = {}  # how many lines each car has crossed
    ahead: int | None = None
    for event in happened:
        at, car = begun + timedelta(milliseconds=event["t"]), event["car"]
        alias = names.get(car, "?")
        if event["kind"] == "sector":
            reached[car] = (event["lap"] - 1) * SECTORS + event["sector"]
            if reached[car] > max((lines for other, lines in reached.items() if other != car), default=0):
                if ahead is not None and ahead != car:
                    passed = {"racer": alias, "other": names.get(ahead, "?")}
                    yield Sentence(at, "leader", _("%(racer)s is past %(other)s.") % passed)
                ahead = car
        elif event["kind"] == "lap":
            lap = {"racer": alias, "number": event["lap"], "time": seconds(event["ms"])}
            yield Sentence(at, "lap", _("%(racer)s: lap %(number)s in %(time)s.") % lap)
        else:
            yield Sentence(at, "incident", incident(event["kind"]) % {"racer": alias, "lap": event["lap"]})


def _outcome(event: LiveEvent, slot: LiveSlot, duels: Duels | None, now: datetime) -> Iterator[Sentence]:
    """Who has won the heat, and the tie or everything with it."""
    at, duel = slot.done_at or now, slot.duel
    if duel is None or duels is None:
        return
    heats = [heat for each in duels.rounds for heat in each.heats if heat.duel.pk == duel.pk]
    cars = heats[0].at_the_end if heats else []
    if not cars or cars[0].place is None:
        yield Sentence(at, "incident", _("The heat of %(racers)s has no result.") % {"racers": slot.who})
        return
    names = [car.entry.racer.alias for car in cars]
    if slot.reason_code == "live_walkover":
        yield Sentence(at, "place", _("%(racer)s wins without driving.") % {"racer": names[0]})
    else:
        words = _("%(racer)s wins the heat, before %(others)s.")
        yield Sentence(at, "place", words % {"racer": names[0], "others": ", ".join(names[1:])})
    tie = _decided_by(event.race, slot, duels)
    if tie is None:
        return
    won = next(car.entry.racer.alias for car in tie.cars if car.won and car.entry is not None)
    lost = ", ".join(car.entry.racer.alias for car in tie.cars if not car.won and car.entry is not None)
    is_final = len(duels.rounds[-1].ties) == 1 and tie.tie.round == duels.rounds[-1].number
    words = (
        _("%(racer)s has won the final against %(other)s.") if is_final else _("%(racer)s advances, %(other)s is out.")
    )
    yield Sentence(at, "leader", words % {"racer": won, "other": lost})


def _decided_by(race: Race, slot: LiveSlot, duels: Duels) -> TreeTie | None:
    """The tie whose last heat this was; None in a round robin, and while the tie is open."""
    duel = slot.duel
    assert duel is not None
    if race.duel_format != DuelFormat.BRACKET:
        return None
    for each in duels.rounds:
        for tie in each.ties:
            if (tie.tie.round, tie.tie.number) == (duel.round, tie_of(duel.number, race.duel_heats)):
                decided = [
                    (heat.duel.decided_at, heat.duel.pk) for heat in tie.heats if heat.duel.decided_at is not None
                ]
                is_last = bool(decided) and max(decided)[1] == duel.pk
                return tie if tie.tie.winner is not None and is_last else None
    return None
