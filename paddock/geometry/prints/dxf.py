"""A track as a DXF of release 12, which every program reads: closed polylines in layers, millimetres.

Format: Autodesk's DXF reference, release 12 (AC1009): pairs of a group's code and its value, a line each.
"""

from __future__ import annotations

from .drawing import COLOURS, Drawing

# the format's own colours: green, grey, white, yellow, red
_INDEX = {"field": 3, "road": 8, "lines": 7, "dashes": 2, "start": 1}


def write_dxf(drawing: Drawing) -> bytes:
    """The outlines of every shape."""
    said: list[tuple[int, object]] = [(999, "Paddock: millimetres"), (0, "SECTION"), (2, "HEADER")]
    said += [(9, "$ACADVER"), (1, "AC1009"), (9, "$INSUNITS"), (70, 4)]
    for name, x, y in (("$EXTMIN", 0.0, 0.0), ("$EXTMAX", drawing.width, drawing.height)):
        said += [(9, name), (10, f"{x:.3f}"), (20, f"{y:.3f}"), (30, "0.0")]
    said += [(0, "ENDSEC"), (0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LAYER"), (70, len(COLOURS))]
    for layer in COLOURS:
        said += [(0, "LAYER"), (2, layer.upper()), (70, 0), (62, _INDEX[layer]), (6, "CONTINUOUS")]
    said += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for layer, shape in drawing.shapes():
        for ring in shape:
            said += [(0, "POLYLINE"), (8, layer.upper()), (66, 1), (10, "0.0"), (20, "0.0"), (30, "0.0"), (70, 1)]
            for x, y in ring.tolist():
                said += [(0, "VERTEX"), (8, layer.upper()), (10, f"{x:.3f}"), (20, f"{y:.3f}"), (30, "0.0")]
            said += [(0, "SEQEND"), (8, layer.upper())]
    said += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code}\n{value}\n" for code, value in said).encode("ascii")
