"""Writes a track as a PDF: one sheet at true size, or pages to print and lay side by side."""

# Format: ISO 32000-1. The file holds the drawing once, as a form that each page shows a part of, and a large page has a
# larger unit; fpdf2 writes neither.

import math
import zlib
from dataclasses import dataclass

import numpy as np

from .drawing import COLOURS, Drawing

POINTS = 72 / 25.4  # of a millimetre
# width and height of a page, millimetres
PAPERS = {"a0": (841, 1189), "a1": (594, 841), "a2": (420, 594), "a3": (297, 420), "a4": (210, 297)}
MARGIN_MM, OVERLAP_MM = 8.0, 10.0  # white on every side; shared by neighbours
_LONGEST = 14_400.0  # units that a page may be long
_CROSS_MM = 4.0


@dataclass(frozen=True)
class Tile:
    """The part of the drawing on one page: its name, and its lower left corner in the drawing."""

    name: str
    x: float
    y: float


def write_pdf(drawing: Drawing) -> bytes:
    """One page of the size of the drawing; longer than five metres with a larger unit (UserUnit, PDF 1.6)."""
    unit = max(1, math.ceil(max(drawing.width, drawing.height) * POINTS / _LONGEST))
    file = _File()
    shape = file.add_stream(_shapes(drawing), _form(drawing))
    scale = POINTS / unit
    file.add_page(
        drawing.width * scale, drawing.height * scale, f"{scale:.8f} 0 0 {scale:.8f} 0 0 cm /D Do", shape, unit
    )
    return file.bytes()


def write_tiles(drawing: Drawing, paper: str) -> bytes:
    """Pages of a paper of :data:`PAPERS`, row by row from the upper left, after one that shows where each belongs.

    Neighbours share :data:`OVERLAP_MM`. Pages without a piece of road are left out.
    """
    width, height = PAPERS[paper]
    tiles, (inner_width, inner_height) = tiles_of(drawing, paper)
    file = _File()
    shape = file.add_stream(_shapes(drawing), _form(drawing))
    file.add_page(width * POINTS, height * POINTS, _overview(drawing, paper, tiles), shape)
    for tile in tiles:
        operators = [
            "q",
            f"{POINTS:.8f} 0 0 {POINTS:.8f} 0 0 cm",
            "q",
            f"{MARGIN_MM} {MARGIN_MM} {inner_width} {inner_height} re W n",
            f"1 0 0 1 {MARGIN_MM - tile.x:.3f} {MARGIN_MM - tile.y:.3f} cm /D Do",
            "Q",
            _crosses(inner_width, inner_height),
            "Q",
            _words(MARGIN_MM, 2.5, 8, f"{drawing.name}   {tile.name}   1:1   {paper.upper()}"),
        ]
        file.add_page(width * POINTS, height * POINTS, "\n".join(operators), shape)
    return file.bytes()


def tiles_of(drawing: Drawing, paper: str) -> tuple[list[Tile], tuple[float, float]]:
    """The pages that show a piece of road, and the width and height of their drawing, millimetres."""
    width, height = PAPERS[paper]
    inner = width - 2 * MARGIN_MM, height - 2 * MARGIN_MM
    step = inner[0] - OVERLAP_MM, inner[1] - OVERLAP_MM
    columns, rows = (
        max(1, math.ceil((size - OVERLAP_MM) / one))
        for size, one in ((drawing.width, step[0]), (drawing.height, step[1]))
    )
    x = np.arange(columns) * step[0]
    y = drawing.height - np.arange(rows) * step[1] - inner[1]
    shown = np.argwhere(_with_road(drawing, x, y, inner)).tolist()
    return [Tile(f"{row + 1}-{column + 1}", float(x[column]), float(y[row])) for row, column in shown], inner


def _with_road(drawing: Drawing, x: np.ndarray, y: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Which of the rectangles with these lower left corners, by row and column, show a piece of road: an edge in it, or
    its middle on the road. ``x`` grows and ``y`` falls, and neighbours overlap."""
    rings = drawing.layers["road"][0]
    start = np.concatenate(rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    low, high = np.minimum(start, end), np.maximum(start, end)
    y = y[::-1]
    # each edge touches a block of rectangles: count blocks by their corners, then add up
    columns = np.searchsorted(x + size[0], low[:, 0]), np.searchsorted(x, high[:, 0], side="right")
    rows = np.searchsorted(y + size[1], low[:, 1]), np.searchsorted(y, high[:, 1], side="right")
    corners = np.zeros((len(y) + 1, len(x) + 1), dtype=np.int64)
    for row in (0, 1):
        for column in (0, 1):
            np.add.at(corners, (rows[row], columns[column]), 1 if row == column else -1)
    found = corners.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0
    middles = x + size[0] / 2
    for row, middle in enumerate(y + size[1] / 2):
        spans = (start[:, 1] > middle) != (end[:, 1] > middle)
        one, other = start[spans], end[spans]
        at = one[:, 0] + (middle - one[:, 1]) * (other[:, 0] - one[:, 0]) / (other[:, 1] - one[:, 1])
        found[row] |= (len(at) - np.searchsorted(np.sort(at), middles, side="right")) % 2 == 1
    return found[::-1]


def _shapes(drawing: Drawing) -> str:
    operators, last = [], ""
    for layer, shape in drawing.shapes():
        if layer != last:
            operators.append(" ".join(f"{part / 255:.4f}" for part in COLOURS[layer]) + " rg")
            last = layer
        for ring in shape:
            first, *others = (f"{x:.3f} {y:.3f}" for x, y in ring.tolist())
            operators.append(f"{first} m " + " ".join(f"{point} l" for point in others) + " h")
        operators.append("f*")
    return "\n".join(operators)


def _form(drawing: Drawing) -> str:
    return f"/Type /XObject /Subtype /Form /BBox [0 0 {drawing.width:.3f} {drawing.height:.3f}]"


def _crosses(width: float, height: float) -> str:
    """Thin crosses where the parts of neighbouring pages end: an overlap in from each corner."""
    operators = ["0.1 w 0.5 G"]
    for x in (MARGIN_MM + OVERLAP_MM, MARGIN_MM + width - OVERLAP_MM):
        for y in (MARGIN_MM + OVERLAP_MM, MARGIN_MM + height - OVERLAP_MM):
            operators.append(f"{x - _CROSS_MM:.3f} {y:.3f} m {x + _CROSS_MM:.3f} {y:.3f} l S")
            operators.append(f"{x:.3f} {y - _CROSS_MM:.3f} m {x:.3f} {y + _CROSS_MM:.3f} l S")
    operators.append(f"{MARGIN_MM} {MARGIN_MM} {width} {height} re S")
    return "\n".join(operators)


def _overview(drawing: Drawing, paper: str, tiles: list[Tile]) -> str:
    """The whole track, as large as the page takes, with the frame and the name of each page."""
    width, height = PAPERS[paper]
    inner = width - 2 * MARGIN_MM, height - 2 * MARGIN_MM
    # pages lie over the drawing's edge on the right and below
    left, right = 0.0, max([drawing.width, *(tile.x + inner[0] for tile in tiles)])
    low, high = min([0.0, *(tile.y for tile in tiles)]), drawing.height
    scale = min(inner[0] / (right - left), (inner[1] - 16) / (high - low))
    operators = [
        "q",
        f"{POINTS:.8f} 0 0 {POINTS:.8f} 0 0 cm",
        f"{scale:.8f} 0 0 {scale:.8f} {MARGIN_MM:.3f} {MARGIN_MM - low * scale:.3f} cm /D Do",
        f"{0.2 / scale:.3f} w 0.8 0.1 0.2 RG",
        *(f"{tile.x:.3f} {tile.y:.3f} {inner[0]} {inner[1]} re S" for tile in tiles),
        "Q",
    ]
    letters = min(14.0, inner[0] * scale * POINTS / 4)
    for tile in tiles:
        x, y = (tile.x + inner[0] * 0.08) * scale, (tile.y - low + inner[1] * 0.06) * scale
        operators.append(_words(MARGIN_MM + x, MARGIN_MM + y, letters, tile.name, "0.8 0.1 0.2"))
    size = f"{drawing.width / 1000:.2f} x {drawing.height / 1000:.2f} m"
    title = f"{drawing.name}: {size}, {len(tiles)} pages {paper.upper()}"
    how = f"Print at 100 %. Neighbours share {OVERLAP_MM:g} mm: cut along the crosses of one and lay it on the other's."
    operators += [_words(MARGIN_MM, height - 14, 11, title), _words(MARGIN_MM, height - 20, 7, how)]
    return "\n".join(operators)


def _words(x: float, y: float, size: float, words: str, colour: str = "0 0 0") -> str:
    """Words at a place, millimetres; letters beyond Latin-1 become question marks."""
    safe = words.encode("latin-1", "replace").decode("latin-1")
    safe = safe.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
    return f"BT {colour} rg /F {size:.2f} Tf {x * POINTS:.3f} {y * POINTS:.3f} Td ({safe}) Tj ET"


class _File:
    """A PDF's objects; the first two are the catalogue and the list of pages, the third is the typeface."""

    def __init__(self) -> None:
        self._objects: list[bytes] = [b"", b"", b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"]
        self._pages: list[int] = []

    def _add(self, content: bytes) -> int:
        self._objects.append(content)
        return len(self._objects)

    def add_stream(self, operators: str, about: str = "") -> int:
        """Add drawing operators; the number of the object."""
        packed = zlib.compress(operators.encode("latin-1"))
        head = f"<< {about} /Filter /FlateDecode /Length {len(packed)} >>\nstream\n".encode()
        return self._add(head + packed + b"\nendstream")

    def add_page(self, width: float, height: float, operators: str, shape: int, unit: int = 1) -> None:
        """Add a page of this size in units, which shows the shape as ``/D``."""
        content = self.add_stream(operators)
        about = f"/MediaBox [0 0 {width:.3f} {height:.3f}]" + (f" /UserUnit {unit}" if unit > 1 else "")
        uses = f"/Resources << /XObject << /D {shape} 0 R >> /Font << /F 3 0 R >> >> /Contents {content} 0 R"
        self._pages.append(self._add(f"<< /Type /Page /Parent 2 0 R {about} {uses} >>".encode()))

    def bytes(self) -> bytes:
        kids = " ".join(f"{page} 0 R" for page in self._pages)
        self._objects[0] = b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>"
        self._objects[1] = f"<< /Type /Pages /Kids [{kids}] /Count {len(self._pages)} >>".encode()
        written = bytearray(b"%PDF-1.6\n%\xe2\xe3\xcf\xd3\n")
        places = []
        for number, content in enumerate(self._objects, 1):
            places.append(len(written))
            written += f"{number} 0 obj\n".encode() + content + b"\nendobj\n"
        start = len(written)
        written += f"xref\n0 {len(places) + 1}\n0000000000 65535 f \n".encode()
        written += b"".join(f"{place:010d} 00000 n \n".encode() for place in places)
        written += f"trailer\n<< /Size {len(places) + 1} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n".encode()
        return bytes(written)
