"""A live event told in sentences, made by rule from what was played: nothing of a run before spectators saw it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

from django.utils.translation import gettext as _

from .live_story_duels import heats_told
from .models import COUNTDOWN, PLAYED_BEHIND, LiveEvent, LiveSlot, Opponents
from .poses import cut
from .ranking import Standing
from .replay import SECTORS
from .selectors.live import on_track, played, running_order
from .selectors.live_runs import DrivenRun, shown_runs
from .story_words import TRACED, Sentence, incident, ordinal, seconds

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
    told: list[Sentence] = []
    traced = {run.slot.pk for run in runs[-TRACED:]}
    for run in runs:
        happened = list(_played(run.slot, now)) if run.slot.pk in traced else _by_laps(run)
        told += _of_run(run.slot, run.alias, happened, known)
        told += _outcome(run, known)
    order = running_order(event)
    playing = on_track(order)
    if event.race.opponents == Opponents.MODELS:
        told += heats_told(event, order, now)
    elif playing is not None and playing.racer is not None:
        told += _of_run(playing, playing.racer.entry.racer.alias, list(_played(playing, now)), known, now)
    for said in event.log.filter(action="interrupt").order_by("-pk")[:MESSAGES]:
        words = _("The site was away: the run of %(racer)s is shown again from its start.")
        told.append(Sentence(said.at, "message", words % {"racer": said.told["racer"]}))
    for said in event.log.filter(action="message", undone_at=None).order_by("-pk")[:MESSAGES]:
        if said.told.get("message"):
            told.append(
                Sentence(said.at, "message", _("The organiser says: %(text)s") % {"text": said.told["message"]})
            )
    return sorted((each for each in told if each.at <= now), key=lambda each: each.at, reverse=True)


def _played(slot: LiveSlot, now: datetime) -> Iterator[dict[str, Any]]:
    """What happened to the car in what was played."""
    after = -1
    while True:
        chunks, _over = played(slot, now, after=after)
        for chunk in chunks:
            yield from (event for event in chunk["events"] if event["car"] == 0)
        if not chunks:
            return
        after = chunks[-1]["n"]


def _by_laps(run: DrivenRun) -> list[dict[str, Any]]:
    """The lines that a shown run crossed."""
    return [event for chunk in cut((), (), {0: run.laps}) for event in chunk["events"]] if run.laps else []


def _of_run(
    slot: LiveSlot, alias: str, happened: Sequence[dict[str, Any]], known: _Known, now: datetime | None = None
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


def _sector(at: datetime, alias: str, event: dict[str, Any], so_far: int, known: _Known) -> Iterator[Sentence]:
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


def _lap(at: datetime, alias: str, event: dict[str, Any], known: _Known) -> Iterator[Sentence]:
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
    """How the racer stands once the run was shown."""
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


def _in(alias: str, ms: int, gap_ms: int, **more: Any) -> dict[str, Any]:
    return {"racer": alias, "time": seconds(ms), "gap": f"{gap_ms / 1000:.3f} s", **more}
