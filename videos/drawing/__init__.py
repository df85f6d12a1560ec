"""The video of a finished run, drawn and encoded on the server; PyAV and OpenCV are loaded by the first call."""

from .scene import FULL, MAX_SECONDS, DrawingStopped, Form, VideoCar, VideoFacts, VideoScene, Words
from .writing import poster, write_animation, write_reel, write_video
