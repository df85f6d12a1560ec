"""The shapes of every print format, in millimetres from the lower left corner of the sheet, as SVG and as DXF."""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from ..checks import Points
from ..markings import Markings, Style, markings_of
from ..track import TrackGeometry

EDGE_MM = 100.0  # from the road to the edge of the sheet
FIELD, ROAD, LINES, DASHES, START = "field", "road", "lines", "dashes", "start"
# red, green and blue by layer, the lowest first; the field is as light as in the camera's picture
COLOURS = {FIELD: (98, 154, 112), ROAD: (58, 60, 64), LINES: (255, 255, 255), DASHES: (236, 178, 44), START: (0, 0, 0)}
# DXF's colours: green, grey, white, yellow, red
_INDEX = {FIELD: 3, ROAD: 8, LINES: 7, DASHES: 2, START: 1}
_TICK_MM = (12.0, 1.0)  # length and width of the mark beside the road where a lap begins


@dataclass(frozen=True)
class Drawing:
    """A track as layers of shapes, millimetres; a shape is a list of closed lines (even-odd)."""

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
    """Corners of two marks beside the road where a lap begins."""
    long, half = _TICK_MM[0] / 1000, _TICK_MM[1] / 2000
    ticks = []
    for sign, edge in zip((1.0, -1.0), track.half_widths_at(0.0), strict=True):
        sides = np.array((edge, edge + long, edge + long, edge)) * sign
        ticks.append(track.points_at(np.array((-half, -half, half, half)), sides))
    return ticks


def write_svg(drawing: Drawing) -> bytes:
    """The drawing as an SVG in millimetres, with a group for each layer."""
    width, height = f"{drawing.width:.2f}", f"{drawing.height:.2f}"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}" fill-rule="evenodd">',
        f"<title>{escape(drawing.name)}</title>",
    ]
    for layer, (red, green, blue) in COLOURS.items():
        lines.append(f'<g id="{layer}" fill="#{red:02x}{green:02x}{blue:02x}">')
        for shape in drawing.layers[layer]:
            rings = (
                "M" + "L".join(f"{x:.2f} {drawing.height - y:.2f}" for x, y in ring.tolist()) + "Z" for ring in shape
            )
            lines.append(f'<path d="{"".join(rings)}"/>')
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""]).encode()


def write_dxf(drawing: Drawing) -> bytes:
    """The outlines of every shape as DXF release 12 in millimetres (Autodesk's DXF reference, AC1009)."""
    groups: list[tuple[int, object]] = [(999, "Paddock: millimetres"), (0, "SECTION"), (2, "HEADER")]
    groups += [(9, "$ACADVER"), (1, "AC1009"), (9, "$INSUNITS"), (70, 4)]
    for name, x, y in (("$EXTMIN", 0.0, 0.0), ("$EXTMAX", drawing.width, drawing.height)):
        groups += [(9, name), (10, f"{x:.3f}"), (20, f"{y:.3f}"), (30, "0.0")]
    groups += [(0, "ENDSEC"), (0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LAYER"), (70, len(COLOURS))]
    for layer in COLOURS:
        groups += [(0, "LAYER"), (2, layer.upper()), (70, 0), (62, _INDEX[layer]), (6, "CONTINUOUS")]
    groups += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for layer, shape in drawing.shapes():
        for ring in shape:
            groups += [(0, "POLYLINE"), (8, layer.upper()), (66, 1), (10, "0.0"), (20, "0.0"), (30, "0.0"), (70, 1)]
            for x, y in ring.tolist():
                groups += [(0, "VERTEX"), (8, layer.upper()), (10, f"{x:.3f}"), (20, f"{y:.3f}"), (30, "0.0")]
            groups += [(0, "SEQEND"), (8, layer.upper())]
    groups += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code}\n{value}\n" for code, value in groups).encode("ascii")
