"""The stream of a live event: its state and the poses of the run on track.

A page that follows ``live:RACE`` polls nothing while the stream holds. It receives the state after each change, without
:data:`LEFT_OUT`, reactions at most once a second, and poses twice a second while a run is played.
"""

import json
import logging
import zlib
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from typing import NotRequired, TypedDict

from django.utils import timezone

from core.streams import Backstage
from paddock.errors import PlatformFault

from ...models import LiveEvent, LiveSlot, SlotState
from ...models.live import UNDER_WAY
from ..document import live_document
from ..selectors.events import played
from .pose_chunks import CHUNK_MS, ChunkDocument, RunEvent, passed

logger = logging.getLogger(__name__)
LEFT_OUT = ("now", "order", "bracket", "reactions")
RECENT = 8  # chunks of the past that a late-comer draws: twice and more of what pages play behind
LOOKED_EVERY_S, RARELY_S = 1.0, 5.0
LEAST_S = 0.1  # between two looks, however much happens on the site
AFTER_S = 0.01  # a chunk is asked for so long after it has passed
MOST_BYTES = 32 * 1024  # of a state; a larger one is asked for by the pages


class PosesBefore(TypedDict):
    """What happened before chunk ``n``."""

    n: int
    events: list[RunEvent]


class PosesUpdate(TypedDict):
    """The next chunks of the run on track; ``before``: for a page that joins during the run."""

    slot: int
    chunks: list[ChunkDocument]
    over: bool
    before: NotRequired[PosesBefore]


class Update(TypedDict, total=False):
    """What a page receives: the event's state or a part of it."""

    state: dict[str, object]
    reactions: dict[str, int]
    poses: PosesUpdate


class EventFeed:
    """The updates that the followers of one event have got from this process, and the next ones."""

    def __init__(self, race: str) -> None:
        self._race = race
        self._event: int | None = None
        self._state = ""
        self._reactions: dict[str, int] = {}
        self._looked_at = 0.0
        self._begins: datetime | None = None
        self._slot: int | None = None
        self._started: datetime | None = None
        self._after = -1
        self._until = 0
        self._is_played = False
        self._rests_s = 0.0
        self._has_moved = False

    def next(self, moved: bool) -> tuple[list[Update], float]:
        """The new updates, and the seconds to wait without a change on the site. ``moved``: there was a change."""
        now = timezone.now()
        updates: list[Update] = []
        self._has_moved |= moved
        if now.timestamp() - self._looked_at >= (LEAST_S if self._has_moved else self._rests_s):
            updates += self._looked(now)
        return updates + self._poses(now), self._pause(now)

    def _looked(self, now: datetime) -> list[Update]:
        self._looked_at, self._has_moved = now.timestamp(), False
        event = event_of(self._race)
        self._event = None if event is None else event.pk
        if event is None:
            self._rests_s = RARELY_S
            return []
        state, reactions = state_of(event, now)
        updates: list[Update] = []
        if reactions != self._reactions:
            self._reactions = reactions
            updates.append({"reactions": reactions})
        is_soon = event.in_lobby(now) or event.state in UNDER_WAY
        self._rests_s = LOOKED_EVERY_S if is_soon else RARELY_S
        written = json.dumps(state)
        if written != self._state:
            self._state = written
            updates.append({"state": state})
        return updates

    def _poses(self, now: datetime) -> list[Update]:
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
        # also sent without new chunks before the run is revealed: pages would otherwise poll for them
        until, before = passed(slot.starts_at, now), self._until
        self._until = until
        is_new = bool(chunks) or over or 0 < until != before
        return [{"poses": {"slot": slot.pk, "chunks": chunks, "over": over}}] if is_new else []

    def _pause(self, now: datetime) -> float:
        rests_s = LEAST_S if self._has_moved else self._rests_s
        pause = max(self._looked_at + rests_s - now.timestamp(), 0.0)
        if self._is_played and self._begins is not None:
            ends = self._begins + (passed(self._begins, now) + 1) * timedelta(milliseconds=CHUNK_MS)
            pause = min(pause, (ends - now).total_seconds() + AFTER_S)
        return pause


async def source(key: str, stage: Backstage) -> AsyncIterator[Update]:
    """The data of the followers of ``live:KEY``, for as long as there are any."""
    feed, moved = EventFeed(key), True
    while True:
        updates, pause = await stage.ask(feed.next, moved)
        for data in updates:
            yield data
        moved = await stage.rest(pause)


def welcome(key: str) -> Update | None:
    """The first data of a new follower; None where there is no live event."""
    event, now = event_of(key), timezone.now()
    if event is None:
        return None
    state, reactions = state_of(event, now)
    first: Update = {"state": state, "reactions": reactions}
    slot = LiveSlot.objects.filter(event=event, state=SlotState.RUNNING).first()
    if slot is not None and slot.starts_at is not None:
        first["poses"] = _so_far(slot, slot.starts_at, now)
    return first


def state_of(event: LiveEvent, now: datetime) -> tuple[dict[str, object], dict[str, int]]:
    """The event as pages draw it, and its reactions; ``{"look": number}`` for one that is too large to be sent, where
    the number is another whenever it changed."""
    document = live_document(event, now)
    state: dict[str, object] = {name: value for name, value in document.items() if name not in LEFT_OUT}
    state["drawn"] = bool(document["bracket"])
    written = json.dumps(state).encode()
    return state if len(written) <= MOST_BYTES else {"look": zlib.crc32(written)}, document["reactions"]


def event_of(key: str) -> LiveEvent | None:
    """The live event of the race with this id."""
    if not key.isdecimal() or len(key) > 15:
        return None
    return LiveEvent.objects.select_related("race__track", "winner__racer").filter(race=int(key)).first()


def _played(slot: LiveSlot, now: datetime, after: int) -> tuple[list[ChunkDocument], bool]:
    """The chunks played so far; none while the storage fails, so that other updates still go out."""
    try:
        return played(slot, now, after=after)
    except PlatformFault as fault:
        logger.warning("The poses of slot %s cannot be read (%s).", slot.pk, fault.code)
        return [], False


def _so_far(slot: LiveSlot, starts_at: datetime, now: datetime) -> PosesUpdate:
    """The last chunks of a run that is played, and what happened in those before."""
    recent = max(0, passed(starts_at, now) - RECENT)
    happened: list[RunEvent] = []
    chunks: list[ChunkDocument] = []
    after = -1
    while some := _played(slot, now, after)[0]:
        after = some[-1]["n"]
        for chunk in some:
            if chunk["n"] >= recent:
                chunks.append(chunk)
            else:
                happened += chunk["events"]
    before: PosesBefore = {"n": recent, "events": happened}
    return {"slot": slot.pk, "chunks": chunks, "over": False, "before": before}
