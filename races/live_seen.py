"""What the cars of a live run see, for its spectators: their cameras' frames of half a second, once it has passed.

They are drawn once for everybody and kept, whoever asks for them: they are of what has been played, and so are equal
for all. They show the front camera of each car, whatever sensors its network has: these are for who may use the model.
"""

from __future__ import annotations

from datetime import datetime
from threading import Lock

from django.core.cache import cache

from evaluation.models import Evaluation
from evaluation.seeing import seen_run

from .models import LiveSlot
from .poses import Chunk
from .selectors.live import played

EVERY = 3  # steps of a chunk that are drawn: the first, and each third after it, five a second
KEPT_S = 600
_WAIT_S = 2.0
_drawing = Lock()  # of many who ask at once, one draws


def frames_of(slot: LiveSlot, now: datetime, n: int, wait_s: float | None = None) -> bytes | None:
    """Chunk ``n`` of a run as a PNG: a row for each car in the order of their numbers, and in it the frames of every
    :data:`EVERY`-th step of the chunk, 160 by 120 pixels each. None unless the chunk has passed; empty while so much
    else is drawn that it would come too late.

    A car that has no step in the chunk stands where it was last. ``wait_s``: for how long others are waited for who
    draw. Raises PlatformFault where files cannot be read."""
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


def _moments(chunk: Chunk) -> list[int]:
    """When the frames of a chunk are, in ms of the run."""
    return next((car["t"][::EVERY] for car in chunk["cars"]), [])


def _drawn(slot: LiveSlot, chunk: Chunk) -> bytes:
    from evaluation.pictures import frame_strip  # brings OpenCV along

    assert slot.evaluation_id is not None
    run = Evaluation.with_sealed.select_related("track", "model", "result").get(pk=slot.evaluation_id)
    moments = _moments(chunk)
    return frame_strip([seen_run(run, car["number"]).frames(moments) for car in chunk["cars"]])
