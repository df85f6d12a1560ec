"""A track for a floor: its files at true size, and what its lines take of tape."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from django.utils.translation import gettext as _

from paddock.geometry.prints import (
    PAPERS,
    Drawing,
    bill_of_tape,
    drawing_of,
    write_dxf,
    write_pdf,
    write_svg,
    write_tiles,
)
from paddock.geometry.prints import tape as kinds
from paddock.geometry.prints.pdf import tiles_of
from paddock.simulator.camera.theme import THEMES

from .models import Track

# what a browser is told, and what writes it
_WHOLE: dict[str, tuple[str, Callable[[Drawing], bytes]]] = {
    "svg": ("image/svg+xml", write_svg),
    "pdf": ("application/pdf", write_pdf),
    "dxf": ("image/vnd.dxf", write_dxf),
}
FORMS = (*_WHOLE, *PAPERS)


def print_file(track: Track, form: str) -> tuple[str, str, bytes]:
    """One of :data:`FORMS`: its name, its type and the file. Raises KeyError for another."""
    drawing = _drawing(track)
    if form in PAPERS:
        return f"{track.slug}-{form}.pdf", "application/pdf", write_tiles(drawing, form)
    kind, write = _WHOLE[form]
    return f"{track.slug}.{form}", kind, write(drawing)


def print_facts(track: Track) -> dict[str, Any]:
    """What the page shows: size in metres, bill of tape, files with what they are, papers with how many pages."""
    drawing = _drawing(track)
    names = {
        kinds.OUTER: _("Outer border"),
        kinds.INNER: _("Inner border"),
        kinds.BORDER: _("Border, all around"),
        kinds.ACROSS: _("Start and finish"),
        kinds.DASHED: _("Dashes in the middle"),
    }
    return {
        "width": f"{drawing.width / 1000:.2f}",
        "height": f"{drawing.height / 1000:.2f}",
        "bill": [
            {
                "name": names[line.kind],
                "colour": _("yellow") if line.kind == kinds.DASHED else _("white"),
                "width": f"{line.width_mm:.1f}",
                "pieces": line.pieces,
                "metres": f"{line.metres:.1f}",
            }
            for line in bill_of_tape(drawing.markings)
        ],
        "whole": [
            ("svg", _("For print shops and drawing programs; a unit is a millimetre.")),
            ("pdf", _("One sheet of the floor's size.")),
            ("dxf", _("For cutting plotters and CAD; millimetres, a layer for each colour.")),
        ],
        "papers": [(paper, len(tiles_of(drawing, paper)[0]) + 1) for paper in PAPERS],
    }


def _drawing(track: Track) -> Drawing:
    return drawing_of(track.geometry, THEMES[track.look])
