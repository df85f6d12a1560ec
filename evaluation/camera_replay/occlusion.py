"""Shows where a network looks: how much its answer changes when a patch of the camera's frame is covered.

Occlusion sensitivity, after Zeiler and Fergus, "Visualizing and Understanding Convolutional Networks" (2014), section
4.2, which works for every network. No Django here.
"""

from collections.abc import Iterator, Mapping, Sequence

import cv2
import numpy as np

from paddock.packages.inputs import CAMERAS

from .sensor_pictures import png_of

PATCH, STRIDE = 20, 10  # pixels of a frame of 160 by 120: 165 patches, each half over the next
LEAST = 0.01  # of the answer; what changes it less is no place to look at
_HUE = np.array((40, 40, 255), np.float32)  # red, as OpenCV writes it
_STRONGEST = 0.65  # how much of the red lies over the frame where the network looks most


def camera_of(readings: Mapping[str, np.ndarray]) -> str | None:
    """The camera among a car's sensors; None for a car without."""
    return next((name for name in sorted(readings) if name in CAMERAS), None)


def covered(readings: Mapping[str, np.ndarray], camera: str) -> Iterator[dict[str, np.ndarray]]:
    """The readings as they are, then once for each patch with that patch of the camera's frame (of both in a stereo
    pair) covered by the mean of the frame, row by row."""
    yield dict(readings)
    frame = readings[camera]
    grey = np.round(frame.mean(axis=(0, 1))).astype(frame.dtype)
    for top, left in _patches(frame):
        hidden = frame.copy()
        hidden[top : top + PATCH, left : left + PATCH] = grey
        yield {**readings, camera: hidden}


def heat(shares: Sequence[Sequence[float]], frame: np.ndarray) -> np.ndarray:
    """How much each pixel matters, 0 to 1, shape (rows, columns) of ``frame``: the mean over its patches of the total
    variation of the answer. ``shares``: the answers to :func:`covered`, each a row of probabilities."""
    as_it_is, *moved = np.array(shares, np.float64)
    total, count = np.zeros(frame.shape[:2]), np.zeros(frame.shape[:2])
    for (top, left), row in zip(_patches(frame), moved, strict=True):
        total[top : top + PATCH, left : left + PATCH] += np.abs(row - as_it_is).sum() / 2
        count[top : top + PATCH, left : left + PATCH] += 1
    return np.clip(total / count, 0.0, 1.0)


def heat_picture(frame: np.ndarray, heat_of: np.ndarray, zoom: int) -> bytes:
    """The (first) frame as a PNG, the redder the more a place matters; nothing is red where no place moves the answer
    by :data:`LEAST`."""
    strongest = float(heat_of.max())
    share = heat_of / strongest if strongest >= LEAST else np.zeros_like(heat_of)
    weight = (_STRONGEST * cv2.GaussianBlur(share, (0, 0), STRIDE / 2))[:, :, None]
    grey = frame[:, :, :1].astype(np.float32).repeat(3, axis=2)
    mixed = np.round(grey * (1 - weight) + _HUE * weight).astype(np.uint8)
    return png_of(mixed.repeat(zoom, axis=0).repeat(zoom, axis=1), 6)


def _patches(frame: np.ndarray) -> Iterator[tuple[int, int]]:
    rows, columns = frame.shape[:2]
    for top in range(0, rows - PATCH + 1, STRIDE):
        for left in range(0, columns - PATCH + 1, STRIDE):
            yield top, left
