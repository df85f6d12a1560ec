"""Fills a frame from pictures of level planes in integer arithmetic, equal on every processor."""

# A camera without roll sees a level plane row by row along straight lines with constant steps. So a row needs only the
# position of its first column and the step, as columns and rows of the plane's picture: 64-bit integers with
# ``FRACTION`` bits after the point. A pixel is the bilinear mean of its four neighbours in the picture, in steps of
# 1/256. Outside of the picture is wall. :class:`NumpyWarp` defines the result, :class:`CompiledWarp` is faster.

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .. import compiled

FRACTION = 32
HALF_WEIGHT = 1 << (FRACTION - 9)  # added to a place, so that truncation rounds its weights


@dataclass(frozen=True)
class Strip:
    """Rows ``first`` to ``last`` (one past) of the frame, drawn from one picture (uint8 (rows, columns)); each the mean
    of 2^``doublings`` lines."""

    pixels: np.ndarray
    first: int
    last: int
    doublings: int

    @property
    def lines(self) -> int:
        return (self.last - self.first) << self.doublings


class Warp(ABC):
    """Draws ``strips``, which together are all rows of a frame: write :attr:`lines` or call :meth:`aim`, call
    :meth:`draw`, read :attr:`frame` (uint8 (rows, columns)).

    ``lines``: int64 (4, lines of all strips): column and row of a line's first pixel in the picture, plus
    ``HALF_WEIGHT``, and the steps in both; no place may be farther off than 2^29 pixels.
    """

    def __init__(self, strips: Sequence[Strip], columns: int, wall: int, terms: np.ndarray | None = None) -> None:
        """``terms``: float64 (4, 4, lines of all strips), for :meth:`aim`."""
        self.strips = [
            Strip(np.ascontiguousarray(strip.pixels, np.uint8), strip.first, strip.last, strip.doublings)
            for strip in strips
        ]
        self.wall = wall
        self.lines = np.zeros((4, sum(strip.lines for strip in strips)), np.int64)
        self.frame = np.zeros((sum(strip.last - strip.first for strip in strips), columns), np.uint8)
        shape = (4, *self.lines.shape)
        self.terms = np.zeros(shape) if terms is None else np.ascontiguousarray(terms, np.float64).reshape(shape)

    @abstractmethod
    def aim(self, cos: float, sin: float, x: float, y: float) -> None:
        """Set the lines of a camera at a place and heading: ``cos`` times the first of the terms plus ``sin`` times the
        second; to the starts alone the third times ``x`` (columns) or ``y`` (rows) plus the fourth; rounded to whole
        numbers. One product and one sum at a time, as fused operations round differently."""

    @abstractmethod
    def draw(self) -> None:
        """Fill the frame from the lines."""

    def see(self, cos: float, sin: float, x: float, y: float, place: np.ndarray | None = None) -> None:
        """:meth:`aim` and :meth:`draw`, into ``place`` (uint8, as many pixels) in place of :attr:`frame` if given."""
        self.aim(cos, sin, x, y)
        self.draw()
        if place is not None:
            place[...] = self.frame.reshape(place.shape)

    def drawing_in(self, place: np.ndarray) -> tuple[int, int] | None:
        """The addresses of the view and of ``place`` for ``paddock_see``; None where C cannot draw there."""
        return None


class NumpyWarp(Warp):
    """The reference, in numpy."""

    def aim(self, cos: float, sin: float, x: float, y: float) -> None:
        by_cos, by_sin, by_place, fixed = self.terms
        sums = by_cos * cos + by_sin * sin
        sums[:2] += by_place[:2] * np.array(((x,), (y,))) + fixed[:2]
        self.lines[:] = np.rint(sums)

    def draw(self) -> None:
        along = np.arange(self.frame.shape[1])
        drawn = 0
        for strip in self.strips:
            column, row, column_step, row_step = self.lines[:, drawn : drawn + strip.lines, None]
            drawn += strip.lines
            sums = self._blended(strip.pixels, column + along * column_step, row + along * row_step)
            sums = sums.reshape(strip.last - strip.first, 1 << strip.doublings, len(along)).sum(axis=1)
            shift = 16 + strip.doublings
            self.frame[strip.first : strip.last] = (sums + (1 << (shift - 1))) >> shift

    def _blended(self, pixels: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Greys, times 2^16, at these places."""
        across, up = (place >> (FRACTION - 8) & 255 for place in (column, row))
        column, row = column >> FRACTION, row >> FRACTION
        low = self._greys(pixels, column, row) * (256 - across) + self._greys(pixels, column + 1, row) * across
        row = row + 1
        high = self._greys(pixels, column, row) * (256 - across) + self._greys(pixels, column + 1, row) * across
        return low * (256 - up) + high * up

    def _greys(self, pixels: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        rows, columns = pixels.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        greys = pixels.reshape(-1).take(row * columns + column, mode="clip")
        return np.where(inside, greys, self.wall)


class CompiledWarp(Warp):
    library: ClassVar[ctypes.CDLL | None] = compiled.library()

    def __init__(self, strips: Sequence[Strip], columns: int, wall: int, terms: np.ndarray | None = None) -> None:
        super().__init__(strips, columns, wall, terms)
        assert self.library is not None
        numbers = [ctypes.c_double] * 4
        self._warp, self._aim, self._see = (getattr(self.library, f"paddock_{name}") for name in ("warp", "aim", "see"))
        self._warp.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
        self._aim.argtypes = (ctypes.c_void_p, *numbers)
        self._see.argtypes = (ctypes.c_void_p, *numbers, ctypes.c_void_p)
        self._warp.restype = self._aim.restype = self._see.restype = None
        # structures of warp.c, which point into arrays of this object
        self._table = np.array(
            [
                (
                    *(strip.pixels.ctypes.data, *strip.pixels.shape[::-1]),
                    *(strip.first, strip.last, strip.doublings, _only_grey(strip.pixels)),
                )
                for strip in self.strips
            ],
            np.int64,
        )
        starts, steps = self.terms[:, :2], self.terms[:2, 2:]
        sides = [*starts[:, 0], *starts[:, 1], *steps[:, 0], *steps[:, 1]]
        self._terms = np.ascontiguousarray(np.transpose(sides))
        self.lines = np.ascontiguousarray(self.lines.T).T  # the four numbers of a line side by side
        self._view = np.array(
            [
                *(self._table.ctypes.data, len(self._table)),
                *(self._terms.ctypes.data, self.lines.ctypes.data, self.lines.shape[1]),
                *(columns, wall),
            ],
            np.int64,
        )
        self._at = self._view.ctypes.data
        self._own = self._place = self.frame.ctypes.data
        self._placed: np.ndarray | None = None  # the array at _place

    def aim(self, cos: float, sin: float, x: float, y: float) -> None:
        self._aim(self._at, cos, sin, x, y)

    def draw(self) -> None:
        self._warp(self._at, self._own)

    def see(self, cos: float, sin: float, x: float, y: float, place: np.ndarray | None = None) -> None:
        if place is None:
            self._see(self._at, cos, sin, x, y, self._own)
            return
        if place is not self._placed:  # the same in nearly every step
            drawing = self.drawing_in(place)
            if drawing is None:
                super().see(cos, sin, x, y, place)
                return
            self._place, self._placed = drawing[1], place
        self._see(self._at, cos, sin, x, y, self._place)

    def drawing_in(self, place: np.ndarray) -> tuple[int, int] | None:
        if not (place.flags.c_contiguous and place.flags.writeable and place.dtype == np.uint8):
            return None
        if place.size != self.frame.size:
            raise ValueError(f"{place.shape} is no place for a frame of {self.frame.shape}")
        return self._at, place.ctypes.data


def _only_grey(pixels: np.ndarray) -> int:
    """The grey of a picture of one grey, such as the sky's, else -1."""
    low, high = int(pixels.min()), int(pixels.max())
    return low if low == high else -1


def best_warp() -> type[Warp]:
    return NumpyWarp if CompiledWarp.library is None else CompiledWarp
