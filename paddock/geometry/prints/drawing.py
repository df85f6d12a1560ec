"""The shapes that every format draws, in millimetres from the lower left corner of the sheet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..checks import Points
from ..markings import Markings, Style, markings_of
from ..track import TrackGeometry

EDGE_MM = 100.0  # from the road to the edge of the sheet: a white line needs something else beside it
FIELD, ROAD, LINES, DASHES, START = "field", "road", "lines", "dashes", "start"
# red, green and blue of what is filled, by layer, the lowest first; the field is as light as cameras see it here
COLOURS = {FIELD: (98, 154, 112), ROAD: (58, 60, 64), LINES: (255, 255, 255), DASHES: (236, 178, 44), START: (0, 0, 0)}
_TICK_MM = (12.0, 1.0)  # length and width of the mark beside the road where a lap begins


@dataclass(frozen=True)
class Drawing:
    """A track as layers of shapes, millimetres; a shape is closed lines, and what lies inside of an odd number of them
    is filled."""

    name: str
    width: float
    height: float
    layers: dict[str, list[list[Points]]]
    markings: Markings

    def shapes(self) -> Iterator[tuple[str, list[Points]]]:
        """Every shape with its layer, the lowest first."""
        for layer in COLOURS:
            for shape in self.layers[layer]:
                yield layer, shape


def drawing_of(track: TrackGeometry, style: Style) -> Drawing:
    """A track in its true size."""
    marks = markings_of(track, style)
    xmin, ymin, xmax, ymax = marks.bounds

    def mm(points: Points) -> Points:
        return (points - (xmin, ymin)) * 1000.0 + EDGE_MM

    size = [(high - low) * 1000.0 + 2 * EDGE_MM for low, high in ((xmin, xmax), (ymin, ymax))]
    layers = {
        FIELD: [[np.array(((0.0, 0.0), (size[0], 0.0), (size[0], size[1]), (0.0, size[1])))]],
        ROAD: [[mm(line) for line in marks.road]],
        LINES: [[mm(outer), mm(inner)] for outer, inner in marks.bands] + [[mm(line)] for line in marks.across],
        DASHES: [[mm(dash)] for dash in marks.dashes],
        START: [] if track.is_open else [[mm(tick)] for tick in _start(track)],
    }
    return Drawing(track.name, size[0], size[1], layers, marks)


def _start(track: TrackGeometry) -> list[Points]:
    """Corners of two marks beside the road, where a lap begins: nothing on the road says it."""
    long, half = _TICK_MM[0] / 1000, _TICK_MM[1] / 2000
    ticks = []
    for sign, edge in zip((1.0, -1.0), track.half_widths_at(0.0), strict=True):
        sides = np.array((edge, edge + long, edge + long, edge)) * sign
        ticks.append(track.points_at(np.array((-half, -half, half, half)), sides))
    return ticks
