"""A live event on the stream: what it is, and the poses of the run on track, to everybody who looks at it.

A page that follows ``live:RACE`` asks for nothing while the stream holds. It is told ``{"state": …}`` when something
changed, without what no page draws (:data:`LEFT_OUT`), ``{"reactions": …}`` at most once a second, and
``{"poses": {"slot", "chunks", "over"}}`` twice a second while a run is played. Whoever comes in the middle is told the
state, the chunks of the last seconds, and of those before only what happened in them: what the clock, the sectors and
the best lap are made of.

Poses come from :func:`races.selectors.live.played` alone, which hands out what has passed by the server's clock.
"""

from __future__ import annotations

import json
import logging
import zlib
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from typing import Any

from django.utils import timezone

from core.streams import Backstage
from paddock.errors import PlatformFault

from .live_document import live_document
from .models import LiveEvent, LiveSlot, SlotState
from .models.live import UNDER_WAY
from .poses import CHUNK_MS, passed
from .selectors.live import played

logger = logging.getLogger(__name__)
LEFT_OUT = ("now", "order", "bracket", "reactions")
RECENT = 8  # chunks of the past that a late-comer draws: twice and more of what pages play behind
LOOKED_EVERY_S, RARELY_S = 1.0, 5.0
LEAST_S = 0.1  # between two looks, however much happens on the site
AFTER_S = 0.01  # a chunk is asked for so long after it has passed
MOST_BYTES = 32 * 1024  # of a state; a larger one is asked for by the pages

Data = dict[str, Any]


class Telling:
    """What the followers of one event have been told by this process, and what they are told next."""

    def __init__(self, race: str) -> None:
        self._race = race
        self._event: int | None = None
        self._state = ""
        self._reactions: Data = {}
        self._looked_at = 0.0
        self._begins: datetime | None = None
        self._slot: int | None = None
        self._started: datetime | None = None
        self._after = -1
        self._until = 0
        self._is_played = False
        self._rests_s = 0.0
        self._has_moved = False

    def next(self, moved: bool) -> tuple[list[Data], float]:
        """What is new now, and for how long nothing will be unless something moves. ``moved``: something did."""
        now = timezone.now()
        said: list[Data] = []
        self._has_moved |= moved
        if now.timestamp() - self._looked_at >= (LEAST_S if self._has_moved else self._rests_s):
            said += self._looked(now)
        return said + self._poses(now), self._pause(now)

    def _looked(self, now: datetime) -> list[Data]:
        self._looked_at, self._has_moved = now.timestamp(), False
        event = event_of(self._race)
        self._event = None if event is None else event.pk
        if event is None:
            self._rests_s = RARELY_S
            return []
        state, reactions = state_of(event, now)
        said: list[Data] = []
        if reactions != self._reactions:
            self._reactions = reactions
            said.append({"reactions": reactions})
        is_soon = event.in_lobby(now) or event.state in UNDER_WAY
        self._rests_s = LOOKED_EVERY_S if is_soon else RARELY_S
        written = json.dumps(state)
        if written != self._state:
            self._state = written
            said.append({"state": state})
        return said

    def _poses(self, now: datetime) -> list[Data]:
        slot = LiveSlot.objects.filter(event=self._event, state=SlotState.RUNNING).first() if self._event else None
        if slot is None and self._slot is not None:
            slot = LiveSlot.objects.filter(pk=self._slot, state=SlotState.DONE).first()
        if slot is None or slot.starts_at is None:
            self._slot, self._is_played = None, False
            return []
        self._begins = slot.starts_at
        if (slot.pk, slot.starts_at) != (self._slot, self._started):  # a run that was interrupted starts again
            self._slot, self._started, self._is_played = slot.pk, slot.starts_at, True
            self._after = passed(slot.starts_at, now) - 1 - RECENT
        chunks, over = _played(slot, now, self._after)
        if chunks:
            self._after = chunks[-1]["n"]
        if over:
            self._slot, self._is_played = None, False
        # that there is nothing more, while it is not revealed, is said too: pages would ask where it is
        until, before = passed(slot.starts_at, now), self._until
        self._until = until
        is_said = bool(chunks) or over or 0 < until != before
        return [{"poses": {"slot": slot.pk, "chunks": chunks, "over": over}}] if is_said else []

    def _pause(self, now: datetime) -> float:
        rests_s = LEAST_S if self._has_moved else self._rests_s
        pause = max(self._looked_at + rests_s - now.timestamp(), 0.0)
        if self._is_played and self._begins is not None:
            ends = self._begins + (passed(self._begins, now) + 1) * timedelta(milliseconds=CHUNK_MS)
            pause = min(pause, (ends - now).total_seconds() + AFTER_S)
        return pause


async def source(key: str, stage: Backstage) -> AsyncIterator[Data]:
    """What followers of ``live:KEY`` are told, for as long as there are any."""
    telling, moved = Telling(key), True
    while True:
        said, pause = await stage.ask(telling.next, moved)
        for data in said:
            yield data
        moved = await stage.rest(pause)


def welcome(key: str) -> Data | None:
    """What who comes now is told first; None where there is no live event."""
    event, now = event_of(key), timezone.now()
    if event is None:
        return None
    state, reactions = state_of(event, now)
    told: Data = {"state": state, "reactions": reactions}
    slot = LiveSlot.objects.filter(event=event, state=SlotState.RUNNING).first()
    if slot is not None and slot.starts_at is not None:
        told["poses"] = _so_far(slot, slot.starts_at, now)
    return told


def state_of(event: LiveEvent, now: datetime) -> tuple[Data, Data]:
    """The event as pages draw it, and its reactions; ``{"look": number}`` for one that is too large to be sent, where
    the number is another whenever it changed."""
    told = live_document(event, now)
    state = {name: value for name, value in told.items() if name not in LEFT_OUT} | {"drawn": bool(told["bracket"])}
    written = json.dumps(state).encode()
    return state if len(written) <= MOST_BYTES else {"look": zlib.crc32(written)}, told["reactions"]


def event_of(key: str) -> LiveEvent | None:
    """The live event of the race with this id."""
    if not key.isdecimal() or len(key) > 15:
        return None
    return LiveEvent.objects.select_related("race__track", "winner__racer").filter(race=int(key)).first()


def _played(slot: LiveSlot, now: datetime, after: int) -> tuple[list[Data], bool]:
    """What has been played; nothing while the storage is away, so that the rest is told all the same."""
    try:
        return played(slot, now, after=after)
    except PlatformFault as fault:
        logger.warning("The poses of slot %s cannot be read (%s).", slot.pk, fault.code)
        return [], False


def _so_far(slot: LiveSlot, starts_at: datetime, now: datetime) -> Data:
    """The last chunks of a run that is played, and of those before what happened and which laps were begun."""
    recent = max(0, passed(starts_at, now) - RECENT)
    happened: list[Data] = []
    laps: dict[int, None] = {}
    chunks: list[Data] = []
    after = -1
    while some := _played(slot, now, after)[0]:
        after = some[-1]["n"]
        for chunk in some:
            if chunk["n"] >= recent:
                chunks.append(chunk)
                continue
            happened += chunk["events"]
            laps |= dict.fromkeys(lap for car in chunk["cars"][:1] for lap in car["lap"])
    before = {"n": recent, "events": happened, "laps": list(laps)}
    return {"slot": slot.pk, "chunks": chunks, "over": False, "before": before}
