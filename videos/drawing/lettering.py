"""Text in the picture of a video."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.cards.lettering import mask, own_font

from .palette import SURFACE, Colour


class Pen(NamedTuple):
    """The style of a text on a panel. ``size``: px; ``align``: which end of the text lies at its place, "left", "right"
    or "middle"."""

    size: float
    colour: Colour
    bold: bool = False
    align: str = "left"


@lru_cache(maxsize=2048)
def _patch(text: str, pen: Pen) -> np.ndarray:
    cover = mask(text, pen.size, pen.bold)[:, :, None].astype(np.float32) / 255.0
    ground, colour = np.array(SURFACE, np.float32), np.array(pen.colour, np.float32)
    return np.rint(ground * (1.0 - cover) + colour * cover).astype(np.uint8)


def write(picture: np.ndarray, text: str, x: float, y: float, pen: Pen) -> int:
    """Write a text with the upper edge of its line at ``y``. Returns its width in px. Clipped to the picture."""
    patch = _patch(text, pen)
    left = round(x) - {"left": 0, "right": patch.shape[1], "middle": patch.shape[1] // 2}[pen.align]
    _put(picture, patch, left, round(y))
    return patch.shape[1]


def figures(picture: np.ndarray, text: str, x: float, y: float, pen: Pen) -> None:
    """As :func:`write`, for a text that changes in every frame: its glyphs are cached. Digits are equally wide."""
    widths = [advance(letter, pen.size) for letter in text]
    at = x - {"left": 0.0, "right": sum(widths), "middle": sum(widths) / 2}[pen.align]
    for letter, width in zip(text, widths, strict=True):
        _put(picture, _patch(letter, pen), round(at), round(y))
        at += width


@lru_cache(maxsize=256)
def advance(letter: str, size: float) -> float:
    return own_font(size).getlength(letter)


def _put(picture: np.ndarray, patch: np.ndarray, left: int, top: int) -> None:
    height, width = picture.shape[:2]
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + patch.shape[1], width), min(top + patch.shape[0], height)
    if x0 < x1 and y0 < y1:
        picture[y0:y1, x0:x1] = patch[y0 - top : y1 - top, x0 - left : x1 - left]
