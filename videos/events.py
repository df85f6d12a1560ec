"""The events of videos."""

from core.events import EventKind, register
from evaluation.running.events import RUN

# subject: the run that is shown
VIDEO_READY = register(EventKind("video.ready", "a video of a run is ready", RUN, ("subject",), ("video",)))
