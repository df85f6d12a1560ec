"""Maps of tracks and of the lines driven on them: SVG for pages, PNG for previews. No Django."""

from .lines import SPEED_CLASSES, DrivenLine
from .marks import BoxMark, CarMark
from .png import draw_png
from .svg import draw_svg, svg_path

__all__ = ["SPEED_CLASSES", "BoxMark", "CarMark", "DrivenLine", "draw_png", "draw_svg", "svg_path"]
