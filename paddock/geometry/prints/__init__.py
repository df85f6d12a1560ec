"""Tracks at true size for a floor: drawings, pages to print and metres of tape."""

from .drawing import Drawing, drawing_of, write_dxf, write_svg
from .pdf import PAPERS, write_pdf, write_tiles
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
