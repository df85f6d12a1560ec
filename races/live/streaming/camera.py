"""Front-camera frames of a live run's cars for its spectators, drawn once for each half second that has passed.

The frames are cached for all spectators. They show the front camera whatever sensors a network has; the other sensors
are for users of the model. On the stream, readers of ``sees:RACE`` receive :class:`FrameData` twice a second while a
run plays. The page requests frames that are too large for a stream, and those from before it connected.
"""

import asyncio
import base64
import logging
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from threading import Lock
from typing import NotRequired, TypedDict

from django.core.cache import cache
from django.utils import timezone

from core.streams import Backstage
from evaluation.camera_replay.replay import seen_run
from evaluation.models import Evaluation
from paddock.errors import PlatformFault

from ...models import LiveSlot, SlotState
from ..selectors.events import played
from .pose_chunks import CHUNK_MS, ChunkDocument, passed

EVERY = 3  # steps of a chunk that are drawn: the first, and each third after it, five a second
KEPT_S = 600
_WAIT_S = 2.0
_drawing = Lock()  # of many who ask at once, one draws


def frames_of(slot: LiveSlot, now: datetime, n: int, wait_s: float | None = None) -> bytes | None:
    """Chunk ``n`` of a run as a PNG: a row for each car in the order of their numbers, and in it the frames of every
    :data:`EVERY`-th step of the chunk, 160 by 120 pixels each. None unless the chunk has passed; empty while so much
    else is drawn that it would come too late.

    A car that has no step in the chunk stands where it was last. ``wait_s``: how long to wait for another
    drawing. Raises PlatformFault where files cannot be read."""
    chunks, _over = played(slot, now, after=n - 1)
    if not chunks or chunks[0]["n"] != n or not _moments(chunks[0]):
        return None
    key = f"live-frames-{slot.evaluation_id}-{n}"
    strip: bytes | None = cache.get(key)
    if strip is not None:
        return strip
    if not _drawing.acquire(timeout=_WAIT_S if wait_s is None else wait_s):
        return b""
    try:
        strip = cache.get(key)
        if strip is None:
            strip = _drawn(slot, chunks[0])
            cache.set(key, strip, KEPT_S)
        return strip
    finally:
        _drawing.release()


def _moments(chunk: ChunkDocument) -> list[int]:
    """When the frames of a chunk are, in ms of the run."""
    return next((car["t"][::EVERY] for car in chunk["cars"]), [])


def _drawn(slot: LiveSlot, chunk: ChunkDocument) -> bytes:
    from evaluation.camera_replay.sensor_pictures import frame_strip  # brings OpenCV along

    assert slot.evaluation_id is not None
    run = Evaluation.with_sealed.select_related("track", "model", "result").get(pk=slot.evaluation_id)
    moments = _moments(chunk)
    return frame_strip([seen_run(run, car["number"]).frames(moments) for car in chunk["cars"]])


logger = logging.getLogger(__name__)
AFTER_S = 0.03  # a chunk's frames come so long after it has passed: its poses go first
AT_ONCE = 2  # chunks; a later reader skips to the newest
STREAM_WAIT_S = 0.1  # for another drawing
LEAST_S, RARELY_S = 0.1, 5.0  # between two looks for a run, unless something moves
MOST_BYTES = 12 * 1024


class FrameData(TypedDict):
    """The frames of chunk ``n`` (:func:`frames_of`); ``png``: in base64, left out where too large for a stream."""

    slot: int
    n: int
    png: NotRequired[str]


class FrameFeed:
    """The frames that the followers of one event have got, and the next ones."""

    def __init__(self, race: str) -> None:
        self._race = int(race) if race.isdecimal() and len(race) <= 15 else 0
        self._run: tuple[int, datetime] | None = None
        self._until = 0

    def next(self) -> tuple[list[FrameData], float]:
        """The new frames, and the seconds to wait without a change on the site."""
        slot = LiveSlot.objects.filter(event__race=self._race, state=SlotState.RUNNING).first()
        if slot is None or slot.starts_at is None:
            return [], RARELY_S
        now = timezone.now()
        until = passed(slot.starts_at, now)
        if self._run != (slot.pk, slot.starts_at):
            self._run, self._until = (slot.pk, slot.starts_at), max(0, until - 1)
        begin, self._until = max(self._until, until - AT_ONCE), until
        frames = [data for n in range(begin, until) if (data := _frame_data(slot, now, n)) is not None]
        ends = slot.starts_at + (until + 1) * timedelta(milliseconds=CHUNK_MS)
        return frames, (ends - timezone.now()).total_seconds() + AFTER_S


async def source(key: str, stage: Backstage) -> AsyncIterator[FrameData]:
    """The data of the followers of ``sees:KEY``, for as long as there are any."""
    feed = FrameFeed(key)
    while True:
        frames, pause = await stage.ask(feed.next)
        for data in frames:
            yield data
        if await stage.rest(pause):  # something moved on the site, and that may be anything
            await asyncio.sleep(LEAST_S)


def _frame_data(slot: LiveSlot, now: datetime, n: int) -> FrameData | None:
    try:
        strip = frames_of(slot, now, n, STREAM_WAIT_S)
    except PlatformFault as fault:
        logger.warning("What slot %s saw cannot be drawn (%s).", slot.pk, fault.code)
        return None
    if not strip:
        return None
    data: FrameData = {"slot": slot.pk, "n": n}
    if len(strip) <= MOST_BYTES:
        data["png"] = base64.b64encode(strip).decode()
    return data
