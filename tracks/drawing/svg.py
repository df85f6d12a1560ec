"""A track map as SVG. Colours come from the page's style sheet through classes. No Django.

Classes: ``track-map`` (the picture), ``track-road``, ``track-centre``, ``track-finish``, ``track-start``,
``track-arrow``,
``track-line`` (with ``speed-0`` to ``speed-5``, slow to fast, and the line's own style), ``track-lane`` (with ``inner``
or ``outer``), ``track-box`` (a shape and its number), ``track-car``. Strokes keep their width in screen pixels at any
size (``vector-effect``), so a style sheet sets ``stroke-width`` in px.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.sax.saxutils import escape

from paddock.geometry.checks import Points
from paddock.geometry.track import TrackGeometry

from .marks import BoxMark, box_corners, lane_line
from .trajectories import Trajectory, simplify, simplify_loop

MARGIN_M = 0.3
LANES = ("inner", "outer")
BOX_MARKS = 0.7  # of the map's mark, that half a box's length is drawn at least

_THIN = 'vector-effect="non-scaling-stroke"'

# For a picture that stands alone, without a page's style sheet: quiet greys that work on dark and on light.
_STYLE = (
    "<style>"
    ".track-road{fill:#8b949e55;stroke:#8b949e}.track-centre{fill:none;stroke:#8b949e;stroke-dasharray:4 4}"
    ".track-start{fill:none;stroke:#8b949e;stroke-width:2.5}"
    ".track-finish,.track-arrow{fill:none;stroke:#ff3b55;stroke-width:2.5}"
    ".track-box path{fill:#d99a3d;stroke:#7a4f10}.track-box text{fill:#1c1206;text-anchor:middle;font-weight:700}"
    ".track-lane{stroke:#5eb0ff}.track-lane.outer{stroke-dasharray:6 4}"
    ".track-line{fill:none;stroke:#2fbf71;stroke-width:2}.track-car{fill:#ff3b55}"
    ".speed-0{stroke:#e5484d}.speed-1{stroke:#f2803a}.speed-2{stroke:#f2c53d}"
    ".speed-3{stroke:#9ccc3c}.speed-4{stroke:#2fbf71}.speed-5{stroke:#1fb6c9}"
    "</style>"
)


def draw_svg(
    track: TrackGeometry,
    *,
    width: int | None = None,
    height: int | None = None,
    trajectory: Sequence[Sequence[float]] | None = None,
    lines: Sequence[Trajectory] = (),
    car: tuple[float, float] | None = None,
    boxes: Sequence[BoxMark] = (),
    lanes: bool = False,
    title: str | None = None,
    standalone: bool = False,
    marks: str = "",
    below_m: float = 0.0,
    line_m: float = 0.0,
) -> str:
    """The map: road, centre line, finish and driving direction, then trajectories, boxes and a car's place.

    ``lanes`` draws the middle of the inner and of the outer lane too.

    ``trajectory`` is the short form of one :class:`Trajectory`; ``car`` a point (x, y) in metres. ``width`` and
    ``height`` are pixels, left out so that the page's layout decides. ``title`` (default: the track's name) is what a
    screen reader says; it may come from a stranger and is escaped. ``standalone`` adds a small style for use outside a
    page.

    ``marks``: SVG of the caller's own, in the map's coordinates (see :func:`svg_path`), drawn on top of the road;
    ``below_m``: room for it below the map. ``line_m``: laps begin and end so many metres after the finish line.
    """
    frame = _Frame(track)
    size = "".join(f' {word}="{int(value)}"' for word, value in (("width", width), ("height", height)) if value)
    ring = "".join(frame.path(simplify_loop(line), closed=True) for line in reversed(track.outlines))
    loop = not track.is_open
    centre = frame.path(simplify_loop(track.centre) if loop else simplify(track.centre), closed=loop)
    if trajectory is not None:
        lines = (*lines, Trajectory(trajectory))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="track-map" role="img"{size} '
        f'viewBox="0 0 {_number(frame.width)} {_number(frame.height + below_m)}">',
        f"<title>{_text(track.name if title is None else title)}</title>",
        _STYLE if standalone else "",
        f'<path class="track-road" fill-rule="evenodd" {_THIN} d="{ring}"/>',
        f'<path class="track-centre" fill="none" {_THIN} d="{centre}"/>',
        *(_lane(frame, track, lane) for lane in LANES if lanes),
        *(_stroke(frame, points, speed, one.style) for one in lines for speed, points in one.strokes()),
        "" if loop else f'<path class="track-start" fill="none" {_THIN} d="{frame.path(start_line(track))}"/>',
        f'<path class="track-finish" fill="none" {_THIN} d="{frame.path(finish_line(track, line_m))}"/>',
        f'<path class="track-arrow" fill="none" {_THIN} d="{frame.path(arrow(track, line_m))}"/>',
    ]
    parts.append(marks)
    parts += [_box(frame, box) for box in boxes]
    if car is not None and math.isfinite(car[0]) and math.isfinite(car[1]):
        x, y = frame.place(car)
        parts.append(f'<circle class="track-car" cx="{x}" cy="{y}" r="{_number(0.8 * frame.mark_m)}"/>')
    parts.append("</svg>")
    return "".join(parts)


def svg_path(track: TrackGeometry, points: Sequence[Sequence[float]] | Points, *, closed: bool = False) -> str:
    """The ``d`` of a path through ``points`` (x, y in metres) in the coordinates of :func:`draw_svg` of this track."""
    return _Frame(track).path(points, closed=closed)


def finish_line(track: TrackGeometry, line_m: float = 0.0) -> tuple[tuple[float, float], tuple[float, float]]:
    """The two ends of the finish line, border to border, square to the track; ``line_m``: moved by so many metres."""
    return _across(track, track.along(track.finish_m + line_m) if line_m else track.finish_m)


def start_line(track: TrackGeometry) -> tuple[tuple[float, float], tuple[float, float]]:
    """The two ends of the line where an open track starts; a loop starts at its finish line."""
    return _across(track, 0.0)


def _across(track: TrackGeometry, metres: float) -> tuple[tuple[float, float], tuple[float, float]]:
    left, right = track.half_widths_at(metres)
    return track.point_at(metres, left)[:2], track.point_at(metres, -right)[:2]


def arrow(track: TrackGeometry, line_m: float = 0.0) -> list[tuple[float, float]]:
    """Three points of a chevron on the road just after the start (``line_m`` after the track's own) that points in the
    driving direction."""
    size = mark_size(track)
    reach = min(size, 0.4 * track.width_at(line_m))
    x, y, heading = track.point_at(line_m + 2.5 * size)
    cos, sin = math.cos(heading), math.sin(heading)
    return [(x + a * cos - b * sin, y + a * sin + b * cos) for a, b in ((-size, reach), (0.0, 0.0), (-size, -reach))]


def mark_size(track: TrackGeometry) -> float:
    """Metres of a mark that is seen on a small map: grows with the map."""
    x_min, y_min, x_max, y_max = track.bounds
    return max(0.2, 0.022 * max(x_max - x_min, y_max - y_min))


class _Frame:
    """The map's coordinates: metres from the upper left corner, y down."""

    def __init__(self, track: TrackGeometry) -> None:
        x_min, y_min, x_max, y_max = track.bounds
        self.left, self.top = x_min - MARGIN_M, y_max + MARGIN_M
        self.width, self.height = x_max - x_min + 2 * MARGIN_M, y_max - y_min + 2 * MARGIN_M
        self.mark_m = mark_size(track)

    def place(self, point: Sequence[float]) -> tuple[str, str]:
        return _number(point[0] - self.left), _number(self.top - point[1])

    def path(self, points: Sequence[Sequence[float]] | Points, *, closed: bool = False) -> str:
        places = (",".join(self.place(point)) for point in points)
        return "M" + " ".join(places) + ("Z" if closed else "")


def _stroke(frame: _Frame, points: Points, speed: int | None, style: str) -> str:
    words = " ".join(word for word in ("track-line", "" if speed is None else f"speed-{speed}", style) if word)
    return f'<path class="{words}" fill="none" {_THIN} d="{frame.path(points)}"/>'


def _lane(frame: _Frame, track: TrackGeometry, lane: str) -> str:
    line, loop = lane_line(track, lane), not track.is_open
    path = frame.path(simplify_loop(line) if loop else simplify(line), closed=loop)
    return f'<path class="track-lane {lane}" fill="none" {_THIN} d="{path}"/>'


def _box(frame: _Frame, box: BoxMark) -> str:
    shape = frame.path(box_corners(box, BOX_MARKS * frame.mark_m), closed=True)
    x, y = frame.place((box.x, box.y))
    size = _number(1.1 * max(box.half_length, BOX_MARKS * frame.mark_m))
    number = f'<text x="{x}" y="{y}" dy=".36em" font-size="{size}">{box.number}</text>' if box.number else ""
    look = "track-box wrong" if box.wrong else "track-box"
    return f'<g class="{look}">{_title(box.title)}<path {_THIN} d="{shape}"/>{number}</g>'


def _title(title: str) -> str:
    return f"<title>{_text(title)}</title>" if title else ""


def _number(value: float) -> str:
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _text(text: str) -> str:
    """Escaped, and without the control characters that XML cannot hold."""
    allowed = (
        c for c in text if c in "\t\n\r" or (c >= " " and not "\ud800" <= c <= "\udfff" and c not in "\ufffe\uffff")
    )
    return escape("".join(allowed))
