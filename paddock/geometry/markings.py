"""The painted markings of a road: border lines, the dashed centre line and lines across it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .checks import Points
from .track import TrackGeometry

_SHARPEST = 4.0  # the greatest distance of a line's inner edge at a corner, in widths


class Style(Protocol):
    """Sizes of lines in metres; a :class:`paddock.simulator.camera.theme.Theme` has them."""

    @property
    def line_width(self) -> float: ...
    @property
    def dash_length(self) -> float: ...
    @property
    def dash_width(self) -> float: ...
    @property
    def dash_pitch(self) -> float: ...


@dataclass(frozen=True)
class Markings:
    """The shapes of one track, metres. ``road``: closed outlines (even-odd). ``bands``: border lines, each as its outer
    and its inner edge, both closed; ``tapes``: the lines midway between them. ``dashes`` and ``across``: corners
    ``(n, 4, 2)``."""

    road: tuple[Points, ...]
    bands: tuple[tuple[Points, Points], ...]
    tapes: tuple[Points, ...]
    dashes: Points
    across: Points
    style: Style

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """The least and greatest x and y of the road: xmin, ymin, xmax, ymax."""
        every = np.vstack(self.road)
        (xmin, ymin), (xmax, ymax) = every.min(axis=0), every.max(axis=0)
        return float(xmin), float(ymin), float(xmax), float(ymax)


def markings_of(track: TrackGeometry, style: Style) -> Markings:
    pairs = list(zip(track.outlines, track.middles, strict=True))
    ends = (0.0, track.finish_m) if track.is_open else ()
    lines = [line_across(track, metres, style.line_width) for metres in ends]
    return Markings(
        road=tuple(track.outlines),
        bands=tuple((border, within(border, middle, style.line_width)) for border, middle in pairs),
        tapes=tuple(within(border, middle, style.line_width / 2) for border, middle in pairs),
        dashes=dashes_of(track, style),
        across=np.stack(lines) if lines else np.zeros((0, 4, 2)),
        style=style,
    )


def within(border: Points, middle: Points, metres: float) -> Points:
    """A closed line moved square to itself towards the middle of the road; ``middle``: a point for each of its own."""
    before, after = border - np.roll(border, 1, axis=0), np.roll(border, -1, axis=0) - border
    before, after = (step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12) for step in (before, after))
    normals = [np.column_stack((-step[:, 1], step[:, 0])) for step in (before, after)]
    both = normals[0] + normals[1]
    # along the bisector, until both neighbouring pieces are ``metres`` away
    square = np.maximum((both * both).sum(axis=1, keepdims=True) / 2, 2 / _SHARPEST**2)
    towards = middle - border
    side = np.sign((both * towards).sum())  # the road lies on one side all the way round
    return border + side * metres * both / square


def line_across(track: TrackGeometry, metres: float, width: float, less_m: float = 0.0) -> Points:
    """Corners (4, 2) of a line across the road that ends at ``metres``, smaller by ``less_m`` on each side."""
    left, right = (half - less_m for half in track.half_widths_at(metres))
    first, last = metres - width + less_m, metres - less_m
    return track.points_at(np.array((first, last, last, first)), np.array((left, left, -right, -right)))


def dashes_of(track: TrackGeometry, style: Style, less_m: float = 0.0) -> Points:
    """Corners (n, 4, 2) of each dash of the centre line, smaller by ``less_m`` on each side; the first begins with the
    road, the pitch fits the length."""
    first, last = track.paved
    count = max(1, round((last - first) / style.dash_pitch))
    pitch, half = (last - first) / count, max(style.dash_width / 2 - less_m, less_m / 2)
    length = max(style.dash_length - 2 * less_m, less_m)
    starts = first + np.arange(count) * pitch + less_m
    corners = ((0.0, half), (length, half), (length, -half), (0.0, -half))
    return np.stack([track.points_at(starts + along, side) for along, side in corners], axis=1)
