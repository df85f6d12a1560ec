"""Encodes pictures as MP4 with H.264 or as an animated WebP: the same bytes for the same pictures."""

from __future__ import annotations

from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from av.video.frame import PictureType

from .scene import Form

KEY_S = 2  # seconds from one key frame to the next
# Flat surfaces and thin lines: x264 at this rate factor leaves no visible blocks, in 1 to 4 Mbit/s.
_OPTIONS = {
    "preset": "superfast",
    "crf": "21",
    "profile": "high",
    "threads": "1",
    "flags": "+bitexact",
    "x264-params": "scenecut=0:weightp=0:sliced-threads=0:videoformat=component",
}
# The matrix and range of OpenCV's conversion; players assume another one by default.
_BT601, _BT709_CURVE, _LIMITED = 6, 1, 1


class Encoder:
    """Writes one file; a context manager that completes the file unless an exception leaves it."""

    def __init__(self, path: Path, form: Form, quality: int | None = None) -> None:
        self._form = form
        if quality is not None:
            self._begin_animation(path, quality)
            return
        options = {"movflags": "+faststart", "fflags": "+bitexact", "use_editlist": "0"}
        self._file = av.open(str(path), "w", format="mp4", options=options)
        with ExitStack() as undo:
            undo.callback(self._file.close)
            stream = self._file.add_stream("libx264", rate=form.fps, options=_OPTIONS)
            stream.width, stream.height, stream.pix_fmt = form.width, form.height, "yuv420p"
            stream.gop_size = KEY_S * form.fps
            stream.time_base = Fraction(1, form.fps)
            context = stream.codec_context
            context.thread_count = 1
            context.max_b_frames = 0
            context.colorspace, context.color_range = _BT601, _LIMITED
            context.color_primaries, context.color_trc = _BT709_CURVE, _BT709_CURVE
            undo.pop_all()
        self._stream = stream
        self._number = 0

    def _begin_animation(self, path: Path, quality: int) -> None:
        self._file = av.open(str(path), "w", format="webp", options={"loop": "0", "fflags": "+bitexact"})
        with ExitStack() as undo:
            undo.callback(self._file.close)
            options = {"quality": str(quality), "compression_level": "2", "flags": "+bitexact"}
            stream = self._file.add_stream("libwebp_anim", rate=self._form.fps, options=options)
            stream.width, stream.height, stream.pix_fmt = self._form.width, self._form.height, "yuv420p"
            stream.time_base = Fraction(1, self._form.fps)
            undo.pop_all()
        self._stream, self._number = stream, 0

    def add(self, picture: np.ndarray) -> None:
        """Add a picture, BGR (height, width, 3)."""
        planes = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = self._number, Fraction(1, self._form.fps)
        if self._number % (KEY_S * self._form.fps) == 0:
            frame.pict_type = PictureType.I
        self._number += 1
        self._file.mux(self._stream.encode(frame))

    def __enter__(self) -> Encoder:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            if kind is None:
                self._file.mux(self._stream.encode(None))
        finally:
            self._file.close()
