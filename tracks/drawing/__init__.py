"""Maps of tracks and of the lines driven on them: SVG for pages, PNG for previews. No Django."""

from .marks import BoxMark
from .png import draw_png
from .svg import draw_svg, svg_path
from .trajectories import SPEED_CLASSES, Trajectory

__all__ = ["SPEED_CLASSES", "BoxMark", "Trajectory", "draw_png", "draw_svg", "svg_path"]
