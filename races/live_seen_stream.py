"""What the cars of a live run see, on the stream: to who has opened that panel, in step with the poses.

Who follows ``sees:RACE`` asks for no frame. They are told ``{"slot", "n", "png"}`` twice a second while a run is
played: the frames of chunk ``n`` (:func:`races.live_seen.frames_of`) in base64, or no ``png`` where it is too large for
a stream; then, and for what was played before they came, they ask.
"""

from __future__ import annotations

import asyncio
import base64
import logging
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from typing import Any

from django.utils import timezone

from core.streams import Backstage
from paddock.errors import PlatformFault

from .live_seen import frames_of
from .models import LiveSlot, SlotState
from .poses import CHUNK_MS, passed

logger = logging.getLogger(__name__)
AFTER_S = 0.03  # a chunk's frames come so long after it has passed: its poses go first
AT_ONCE = 2  # chunks; whoever is later than that goes on with the newest
WAIT_S = 0.1  # for others who draw
LEAST_S, RARELY_S = 0.1, 5.0  # between two looks for a run, unless something moves
MOST_BYTES = 12 * 1024

Data = dict[str, Any]


class Seeing:
    """Which frames the followers of one event have been told, and what they are told next."""

    def __init__(self, race: str) -> None:
        self._race = int(race) if race.isdecimal() and len(race) <= 15 else 0
        self._run: tuple[int, datetime] | None = None
        self._until = 0

    def next(self) -> tuple[list[Data], float]:
        """What is new now, and for how long nothing will be unless something moves."""
        slot = LiveSlot.objects.filter(event__race=self._race, state=SlotState.RUNNING).first()
        if slot is None or slot.starts_at is None:
            return [], RARELY_S
        now = timezone.now()
        until = passed(slot.starts_at, now)
        if self._run != (slot.pk, slot.starts_at):
            self._run, self._until = (slot.pk, slot.starts_at), max(0, until - 1)
        begin, self._until = max(self._until, until - AT_ONCE), until
        told = [data for n in range(begin, until) if (data := _told(slot, now, n)) is not None]
        ends = slot.starts_at + (until + 1) * timedelta(milliseconds=CHUNK_MS)
        return told, (ends - timezone.now()).total_seconds() + AFTER_S


async def source(key: str, stage: Backstage) -> AsyncIterator[Data]:
    """What followers of ``sees:KEY`` are told, for as long as there are any."""
    seeing = Seeing(key)
    while True:
        said, pause = await stage.ask(seeing.next)
        for data in said:
            yield data
        if await stage.rest(pause):  # something moved on the site, and that may be anything
            await asyncio.sleep(LEAST_S)


def _told(slot: LiveSlot, now: datetime, n: int) -> Data | None:
    try:
        strip = frames_of(slot, now, n, WAIT_S)
    except PlatformFault as fault:
        logger.warning("What slot %s saw cannot be drawn (%s).", slot.pk, fault.code)
        return None
    if not strip:
        return None
    told: Data = {"slot": slot.pk, "n": n}
    return told | {"png": base64.b64encode(strip).decode()} if len(strip) <= MOST_BYTES else told
