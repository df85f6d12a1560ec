"""What happens to videos, as events."""

from __future__ import annotations

from core.events import Kind, register
from evaluation.events import RUN

# subject: the run that is shown
VIDEO_READY = register(Kind("video.ready", "a video of a run is ready", RUN, ("subject",), ("video",)))
