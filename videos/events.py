"""The events of videos."""

from core.events import EventKind, register

# subject: the run that is shown
VIDEO_READY = register(EventKind("video.ready", "a video of a run is ready", ("subject",), ("video",)))
