"""A track to print at true size, and the tape that its lines need."""

import threading
from collections.abc import Callable
from functools import lru_cache

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
from paddock.geometry.track import TrackGeometry
from paddock.simulator.camera.theme import THEMES

from ..models import Track

# the content type and the writer of each format
_WHOLE: dict[str, tuple[str, Callable[[Drawing], bytes]]] = {
    "svg": ("image/svg+xml", write_svg),
    "pdf": ("application/pdf", write_pdf),
    "dxf": ("image/vnd.dxf", write_dxf),
}
FORMS = (*_WHOLE, *PAPERS)
KEPT = 32  # files of each process, up to a megabyte each; a track's shape and look never change
_WRITING = threading.Lock()  # however many visitors ask, each process draws one file at a time


def print_file(track: Track, form: str) -> tuple[str, str, bytes]:
    """One of :data:`FORMS`: its name, its type and the file. Raises KeyError for another."""
    kind = _WHOLE[form][0] if form in _WHOLE else "application/pdf"
    name = f"{track.slug}-{form}.pdf" if form in PAPERS else f"{track.slug}.{form}"
    with _WRITING:
        return name, kind, _written(track.geometry, track.look, form)


@lru_cache(maxsize=KEPT)
def _written(geometry: TrackGeometry, look: str, form: str) -> bytes:
    drawing = drawing_of(geometry, THEMES[look])
    return write_tiles(drawing, form) if form in PAPERS else _WHOLE[form][1](drawing)


def print_facts(track: Track) -> dict[str, object]:
    """What the page shows: size in metres, bill of tape, files with what they are, papers with how many pages."""
    drawing = drawing_of(track.geometry, THEMES[track.look])
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
