"""Maps of tracks and of the lines driven on them: SVG for pages, PNG for previews. No Django."""

from .lines import SPEED_CLASSES, DrivenLine
from .marks import BoxMark
from .png import draw_png
from .svg import draw_svg, svg_path

__all__ = ["SPEED_CLASSES", "BoxMark", "DrivenLine", "draw_png", "draw_svg", "svg_path"]
