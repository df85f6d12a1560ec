"""Encodes pictures as MP4 with H.264 or as an animated WebP: the same bytes for the same pictures."""

from __future__ import annotations

from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import cv2
import numpy as np
from av.video.frame import PictureType
from av.video.stream import VideoStream

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
        """``quality``: of an animated WebP, 1 to 100; None for MP4."""
        self._form, self._number = form, 0
        if quality is None:
            kind, codec, options = "mp4", "libx264", _OPTIONS
            of_file = {"movflags": "+faststart", "use_editlist": "0"}
        else:
            kind, codec, of_file = "webp", "libwebp_anim", {"loop": "0"}
            options = {"quality": str(quality), "compression_level": "2", "flags": "+bitexact"}
        self._file = av.open(str(path), "w", format=kind, options={**of_file, "fflags": "+bitexact"})
        with ExitStack() as undo:
            undo.callback(self._file.close)
            stream = cast(VideoStream, self._file.add_stream(codec, rate=form.fps, options=options))
            stream.width, stream.height, stream.pix_fmt = form.width, form.height, "yuv420p"
            stream.time_base = Fraction(1, form.fps)
            if quality is None:
                stream.gop_size = KEY_S * form.fps
                context = stream.codec_context
                context.thread_count = 1
                context.max_b_frames = 0
                context.colorspace, context.color_range = _BT601, _LIMITED
                context.color_primaries, context.color_trc = _BT709_CURVE, _BT709_CURVE
            undo.pop_all()
        self._stream = stream

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
