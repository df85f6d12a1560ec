"""What happens to videos, as events."""

from __future__ import annotations

from core.events import EventKind, register
from evaluation.events import RUN

# subject: the run that is shown
VIDEO_READY = register(EventKind("video.ready", "a video of a run is ready", RUN, ("subject",), ("video",)))
