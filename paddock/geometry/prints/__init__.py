"""Tracks at their true size, for a floor: as drawings, as pages to print, as metres of tape. No Django."""

from .drawing import Drawing, drawing_of
from .dxf import write_dxf
from .pdf import PAPERS, write_pdf, write_tiles
from .svg import write_svg
from .tape import Line, bill_of_tape

__all__ = [
    "PAPERS",
    "Drawing",
    "Line",
    "bill_of_tape",
    "drawing_of",
    "write_dxf",
    "write_pdf",
    "write_svg",
    "write_tiles",
]
