"""The video of a finished run, drawn and encoded on the server.

:func:`film` writes it, :func:`poster` draws its still; what is shown is a :class:`Scene`. No database, no request.
Importing this room loads neither PyAV nor OpenCV: both are loaded by the first call.
"""

from .scene import FULL, MAX_SECONDS, FilmedCar, FilmFacts, Form, Scene, Stopped, Words
from .shoot import film, poster

__all__ = [
    "FULL",
    "MAX_SECONDS",
    "FilmFacts",
    "FilmedCar",
    "Form",
    "Scene",
    "Stopped",
    "Words",
    "film",
    "poster",
]
