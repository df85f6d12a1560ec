"""Fill a frame from pictures of level planes, in whole numbers: the same to the bit on every processor.

A camera that does not roll sees a level plane row by row along straight lines, at a constant step from a column to the
next. So a row needs no division for each of its pixels, only its line: where its first column looks, and the step, as
columns and rows of the plane's picture. Places are 64-bit numbers with ``FRACTION`` bits after the point.

A pixel is the mean of its four neighbours in the picture, weighed by how near they are (bilinear) in steps of 1/256;
what lies outside of the picture is wall. Rows of the frame that cover much ground are the mean of several lines.

There are two ways that draw the same: :class:`NumpyWarp` says what is drawn, :class:`CompiledWarp` is many times as
fast and needs what :mod:`..compiled` makes.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .. import compiled

FRACTION = 32
HALF_WEIGHT = 1 << (FRACTION - 9)  # added to a place, so that cutting off its weights rounds them


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
        """How many lines it takes."""
        return (self.last - self.first) << self.doublings


class Warp(ABC):
    """Draws ``strips``, which together are all rows of a frame. Write :attr:`lines` or :meth:`aim`, call :meth:`draw`,
    read :attr:`frame` (uint8 (rows, columns)).

    ``lines``: int64 (4, lines of all strips): column and row of the picture where a line's first pixel looks, plus
    ``HALF_WEIGHT``, and the steps in both. No place on a line may be farther off than 2^29 pixels.
    """

    def __init__(self, strips: Sequence[Strip], columns: int, wall: int, terms: np.ndarray | None = None) -> None:
        """``terms``: float64 (4, 4, lines of all strips), what :meth:`aim` makes lines of."""
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
        """Write down the lines of a camera at a place and heading: ``cos`` times the first of the terms and ``sin``
        times the second, added; to the starts alone the sum of the third times ``x`` (columns) or ``y`` (rows) and
        the fourth; rounded to whole numbers. Product by product and sum by sum: what multiplies and adds in one step,
        as matrix products do on some processors, rounds otherwise."""

    @abstractmethod
    def draw(self) -> None:
        """Fill the frame from the lines."""

    def see(self, cos: float, sin: float, x: float, y: float, place: np.ndarray | None = None) -> None:
        """:meth:`aim` and :meth:`draw`; with ``place`` (uint8, as many pixels as the frame has) that is filled, which
        is only written to, and :attr:`frame` then holds nothing of use."""
        self.aim(cos, sin, x, y)
        self.draw()
        if place is not None:
            place[...] = self.frame.reshape(place.shape)


class NumpyWarp(Warp):
    """The one that needs nothing but numpy, and that the other is held against."""

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
    """The one in C, a call for each frame."""

    library: ClassVar[ctypes.CDLL | None] = compiled.load()

    def __init__(self, strips: Sequence[Strip], columns: int, wall: int, terms: np.ndarray | None = None) -> None:
        super().__init__(strips, columns, wall, terms)
        assert self.library is not None
        numbers = [ctypes.c_double] * 4
        self._warp, self._aim, self._see = (getattr(self.library, f"paddock_{name}") for name in ("warp", "aim", "see"))
        self._warp.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
        self._aim.argtypes = (ctypes.c_void_p, *numbers)
        self._see.argtypes = (ctypes.c_void_p, *numbers, ctypes.c_void_p)
        self._warp.restype = self._aim.restype = self._see.restype = None
        # Structures of warp.c; the arrays stay where they are as long as this object has them.
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
        if place is not self._placed:  # it is the same in nearly every step, and to look where it is takes a while
            if not (place.flags.c_contiguous and place.flags.writeable and place.dtype == np.uint8):
                super().see(cos, sin, x, y, place)
                return
            if place.size != self.frame.size:
                raise ValueError(f"{place.shape} is no place for a frame of {self.frame.shape}")
            self._place, self._placed = place.ctypes.data, place
        self._see(self._at, cos, sin, x, y, self._place)


def _only_grey(pixels: np.ndarray) -> int:
    """The grey of a picture that has no other, such as the sky's; -1 of any other picture."""
    low, high = int(pixels.min()), int(pixels.max())
    return low if low == high else -1


def best_warp() -> type[Warp]:
    """The faster of the two where it is there."""
    return NumpyWarp if CompiledWarp.library is None else CompiledWarp
