"""Rule-based commentary on a live event, restricted to what spectators have seen."""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

from django.utils.translation import gettext as _

from ..boards.ranking import Standing
from ..duels.bracket import tie_of
from ..duels.selectors import Duels, TreeTie, duels_of
from ..models import COUNTDOWN, PLAYED_BEHIND, DuelFormat, LiveEvent, LiveSlot, Opponents, Race, SlotState
from ..replays.run_maps import SECTORS
from .selectors.events import all_played, on_track, running_order
from .selectors.runs import DrivenRun, shown_runs
from .streaming.pose_chunks import RunEvent, cut

TRACED = 6  # runs whose traces are read for incidents between two lines; to read all would take seconds


@dataclass(frozen=True)
class Sentence:
    """A sentence. ``at``: when it was seen; ``kind``: what it is about, for its colour."""

    at: datetime
    kind: str
    text: str

    @property
    def key(self) -> str:
        """Identifies the sentence on a page that updates itself."""
        return f"{self.at:%H%M%S%f}-{zlib.crc32(self.text.encode()):x}"


def incident(kind: str) -> str:
    """What went wrong with ``racer`` in ``lap``."""
    return {
        "off_track": _("%(racer)s leaves the track in lap %(lap)s."),
        "crashed": _("%(racer)s hits something in lap %(lap)s."),
        "immobilized": _("%(racer)s stands still in lap %(lap)s."),
        "reversed": _("%(racer)s drives the wrong way in lap %(lap)s."),
        "time_up": _("%(racer)s's time is up."),
    }[kind]


def ordinal(place: int) -> str:
    """A place in words: ``1st``, ``12th``, ``23rd``."""
    if place % 100 not in (11, 12, 13):
        words = {1: _("%(place)sst"), 2: _("%(place)snd"), 3: _("%(place)srd")}.get(place % 10)
        if words:
            return words % {"place": place}
    return _("%(place)sth") % {"place": place}


def seconds(ms: int) -> str:
    """A time of a story: ``8.531 s``, from a minute on ``1:08.531``."""
    return f"{ms // 60_000}:{ms / 1000 % 60:06.3f}" if ms >= 60_000 else f"{ms / 1000:.3f} s"


MESSAGES = 20
POSSIBLE = 0.8  # of the event's fastest last sector: no car improves on it by more, so no sentence is written


@dataclass
class _Known:
    """What has been seen so far, in ms."""

    fastest: tuple[int, str] | None = None  # lap of the event, and whose
    own: dict[str, int] = field(default_factory=dict)  # best lap by racer
    sectors: dict[int, int] = field(default_factory=dict)
    own_sectors: dict[tuple[str, int], int] = field(default_factory=dict)
    best: dict[str, Standing] = field(default_factory=dict)

    def ranked(self) -> list[str]:
        return sorted(self.best, key=lambda alias: self.best[alias].key)


def story_of(event: LiveEvent, now: datetime) -> list[Sentence]:
    """All that was seen by ``now``, the latest first. Spectators' pages play behind the clock, and so does this."""
    runs = shown_runs(event)
    known = _Known()
    sentences: list[Sentence] = []
    traced = {run.slot.pk for run in runs[-TRACED:]}
    for run in runs:
        happened = _played(run.slot, now) if run.slot.pk in traced else _by_laps(run)
        sentences += _of_run(run.slot, run.alias, happened, known)
        sentences += _outcome(run, known)
    order = running_order(event)
    playing = on_track(order)
    if event.race.opponents == Opponents.MODELS:
        sentences += heat_sentences(event, order, now)
    elif playing is not None and playing.racer is not None:
        sentences += _of_run(playing, playing.racer.entry.racer.alias, _played(playing, now), known, now)
    words = _("The site was away: the run of %(racer)s is shown again from its start.")
    interrupted = event.log.filter(action="interrupt").order_by("-pk")
    for at, racer in interrupted.values_list("at", "told__racer")[:MESSAGES]:
        sentences.append(Sentence(at, "message", words % {"racer": racer}))
    messages = event.log.filter(action="message", undone_at=None).order_by("-pk")
    for at, text in messages.values_list("at", "told__message")[:MESSAGES]:
        if text:
            sentences.append(Sentence(at, "message", _("Organiser: %(text)s") % {"text": text}))
    return sorted((each for each in sentences if each.at <= now), key=lambda each: each.at, reverse=True)


def _played(slot: LiveSlot, now: datetime) -> list[RunEvent]:
    """The events in the chunks played so far."""
    return [event for chunk in all_played(slot, now) for event in chunk["events"]]


def _by_laps(run: DrivenRun) -> list[RunEvent]:
    """The lines that a shown run crossed."""
    return [event for chunk in cut((), (), {0: run.laps}) for event in chunk["events"]] if run.laps else []


def _of_run(
    slot: LiveSlot, alias: str, happened: Sequence[RunEvent], known: _Known, now: datetime | None = None
) -> Iterator[Sentence]:
    assert slot.starts_at is not None
    begun = slot.starts_at + PLAYED_BEHIND
    if now is not None and now < begun:
        called = min(now, slot.starts_at - COUNTDOWN)
        yield Sentence(called, "start", _("%(racer)s is about to start.") % {"racer": alias})
        return
    yield Sentence(begun, "start", _("%(racer)s is on track, round %(round)s.") % {"racer": alias, "round": slot.round})
    in_lap: dict[int, int] = {}
    for event in happened:
        at = begun + timedelta(milliseconds=event["t"])
        if event["kind"] == "sector":
            in_lap[event["lap"]] = in_lap.get(event["lap"], 0) + event["ms"]
            yield from _sector(at, alias, event, in_lap[event["lap"]], known)
        elif event["kind"] == "lap":
            yield from _lap(at, alias, event, known)
        else:
            yield Sentence(at, "incident", incident(event["kind"]) % {"racer": alias, "lap": event["lap"]})


def _sector(at: datetime, alias: str, event: RunEvent, so_far: int, known: _Known) -> Iterator[Sentence]:
    number, ms = event["sector"], event["ms"]
    best = known.sectors.get(number)
    if best is not None and ms < best:
        words = _("%(racer)s has the fastest sector %(number)s: %(time)s, %(gap)s quicker than before.")
        yield Sentence(at, "sector", words % _in(alias, ms, best - ms, number=number))
    known.sectors[number] = min(ms, best or ms)
    own = known.own_sectors.get((alias, number))
    known.own_sectors[alias, number] = min(ms, own or ms)
    if number != SECTORS - 1 or known.fastest is None:
        return
    needs, last = known.fastest[0] - so_far, known.own_sectors.get((alias, SECTORS))
    if needs <= 0:
        yield Sentence(at, "needs", _("No fastest lap for %(racer)s.") % {"racer": alias})
    elif needs < POSSIBLE * known.sectors.get(SECTORS, 0):
        return
    elif last is None or needs == last:
        words = _("%(racer)s needs %(time)s in the last sector for the fastest lap.")
        yield Sentence(at, "needs", words % _in(alias, needs, 0))
    elif needs > last:
        words = _("%(racer)s needs %(time)s in the last sector for the fastest lap, and has driven it %(gap)s quicker.")
        yield Sentence(at, "needs", words % _in(alias, needs, needs - last))
    else:
        words = _("%(racer)s needs %(time)s in the last sector for the fastest lap: %(gap)s quicker than ever there.")
        yield Sentence(at, "needs", words % _in(alias, needs, last - needs))


def _lap(at: datetime, alias: str, event: RunEvent, known: _Known) -> Iterator[Sentence]:
    ms, fastest, own = event["ms"], known.fastest, known.own.get(alias)
    if fastest is None or ms < fastest[0]:
        if fastest is None:
            words, values = _("%(racer)s sets the first time: %(time)s."), _in(alias, ms, 0)
        else:
            words = _("Fastest lap! %(racer)s drives %(time)s, %(gap)s quicker than %(other)s before.")
            values = _in(alias, ms, fastest[0] - ms, other=fastest[1])
        known.fastest = (ms, alias)
        yield Sentence(at, "fastest", words % values)
    elif ms == fastest[0]:
        yield Sentence(at, "lap", _("%(racer)s equals the fastest lap: %(time)s.") % _in(alias, ms, 0))
    elif own is None or ms < own:
        words = _("%(racer)s: own best lap %(time)s, %(gap)s off the fastest.")
        yield Sentence(at, "lap", words % _in(alias, ms, ms - fastest[0]))
    else:
        words = _("%(racer)s: lap %(number)s in %(time)s, %(gap)s off the fastest.")
        yield Sentence(at, "lap", words % _in(alias, ms, ms - fastest[0], number=event["lap"]))
    known.own[alias] = min(ms, own or ms)


def _outcome(run: DrivenRun, known: _Known) -> Iterator[Sentence]:
    """The racer's standing after the run."""
    at = run.slot.done_at
    assert at is not None
    if run.standing is None:
        yield Sentence(at, "incident", _("The run of %(racer)s has no result.") % {"racer": run.alias})
        return
    before = known.ranked()
    held = known.best.get(run.alias)
    if held is not None and held.key <= run.standing.key:
        place = before.index(run.alias) + 1
        yield Sentence(at, "place", _("%(racer)s stays %(place)s.") % {"racer": run.alias, "place": ordinal(place)})
        return
    known.best[run.alias] = run.standing
    after = known.ranked()
    place = after.index(run.alias) + 1
    if place > 1 or not run.standing.classified:
        yield Sentence(at, "place", _("%(racer)s is %(place)s.") % {"racer": run.alias, "place": ordinal(place)})
    elif before and before[0] != run.alias:
        words = _("New leader: %(racer)s, before %(other)s.")
        yield Sentence(at, "leader", words % {"racer": run.alias, "other": before[0]})
    else:
        yield Sentence(at, "leader", _("%(racer)s leads.") % {"racer": run.alias})


def _in(alias: str, ms: int, gap_ms: int, **more: Any) -> dict[str, object]:
    return {"racer": alias, "time": seconds(ms), "gap": f"{gap_ms / 1000:.3f} s", **more}


def heat_sentences(event: LiveEvent, order: Sequence[LiveSlot], now: datetime) -> Iterator[Sentence]:
    """Sentences on what spectators saw of the running order's heats until ``now``."""
    shown = sorted((slot for slot in order if slot.state == SlotState.DONE), key=lambda slot: slot.done_at or now)
    duels = duels_of(event.race)
    traced = {slot.pk for slot in shown[-TRACED:]}
    for slot in shown:
        if slot.pk in traced and slot.starts_at is not None:
            yield from _heat(slot, _played(slot, now))
        yield from reversed(list(_heat_outcome(event, slot, duels, now)))  # the latest first: at one moment, too
    playing = on_track(order)
    if playing is None or playing.starts_at is None:
        return
    if now < playing.starts_at + PLAYED_BEHIND:
        called = min(now, playing.starts_at - COUNTDOWN)
        yield Sentence(called, "start", _("%(racers)s are about to start.") % {"racers": playing.driver_names})
    else:
        yield from _heat(playing, _played(playing, now))


def _heat(slot: LiveSlot, happened: Sequence[RunEvent]) -> Iterator[Sentence]:
    assert slot.starts_at is not None
    begun = slot.starts_at + PLAYED_BEHIND
    words = _("%(racers)s are on track, round %(round)s.")
    yield Sentence(begun, "start", words % {"racers": slot.driver_names, "round": slot.round})
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


def _heat_outcome(event: LiveEvent, slot: LiveSlot, duels: Duels | None, now: datetime) -> Iterator[Sentence]:
    """The winner of the heat, and of the tie or the event that it decides."""
    at, duel = slot.done_at or now, slot.duel
    if duel is None or duels is None:
        return
    heats = [heat for heat in duels.heats if heat.duel.pk == duel.pk]
    cars = heats[0].at_the_end if heats else []
    if not cars or cars[0].place is None:
        yield Sentence(at, "incident", _("The heat of %(racers)s has no result.") % {"racers": slot.driver_names})
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
