"""The video of a finished run, drawn and encoded on the server.

:func:`write_video` writes it, :func:`poster` draws its still, both of a :class:`VideoScene`. No database, no request.
Importing this room loads neither PyAV nor OpenCV: both are loaded by the first call.
"""

from .scene import FULL, MAX_SECONDS, Form, Stopped, VideoCar, VideoFacts, VideoScene, Words
from .writing import poster, write_reel, write_video

__all__ = [
    "FULL",
    "MAX_SECONDS",
    "Form",
    "Stopped",
    "VideoCar",
    "VideoFacts",
    "VideoScene",
    "Words",
    "poster",
    "write_reel",
    "write_video",
]
