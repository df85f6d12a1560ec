"""Track maps as SVG with driven lines and boxes, coloured by the page's style sheet. No Django.

Classes: ``track-map``, ``track-road``, ``track-kerb``, ``track-centre``, ``track-finish``, ``track-start``,
``track-arrow``, ``track-line`` (with ``speed-0`` to ``speed-5``, slow to fast, and the line's style), ``track-lane``
(with ``inner`` or ``outer``), ``track-box``. Strokes keep their width in screen pixels (``vector-effect``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np

from paddock.geometry.character import STEP_M, corners_of
from paddock.geometry.checks import Points
from paddock.geometry.track import TrackGeometry

MARGIN_M = 0.3
LANES = ("inner", "outer")
BOX_MARKS = 0.7  # of the map's mark, that half a box's length is drawn at least

LANE_STEP_M = 0.15
KERB_ROWS = 3  # of a corner, from one point of its kerb to the next
KERB_ERROR_M = 0.03
ERROR_M = 0.01
JUMP_M = 0.6  # the fastest car moves 0.27 m in a step; a longer one is a reset and is not drawn
SPEED_CLASSES = 6
TOP_SPEED_MPS = 4.0

_THIN = 'vector-effect="non-scaling-stroke"'

# For a picture that stands alone, without a page's style sheet: a road that is seen on dark and on light.
_STYLE = (
    "<style>"
    ".track-road{fill:#4a525d;stroke:#e3e8ee;stroke-width:1.5}.track-kerb{fill:none;stroke:#ff3b55;stroke-width:3;"
    "stroke-dasharray:4 4}.track-centre{fill:none;stroke:#e8b84a;stroke-dasharray:4 5}"
    ".track-start,.track-finish{fill:none;stroke:#fff;stroke-width:5;stroke-dasharray:3 3}"
    ".track-arrow{fill:none;stroke:#ff3b55;stroke-width:2.5}"
    ".track-box path{fill:#d99a3d;stroke:#7a4f10}.track-box text{fill:#1c1206;text-anchor:middle;font-weight:700}"
    ".track-lane{stroke:#5eb0ff}.track-lane.outer{stroke-dasharray:6 4}"
    ".track-line{fill:none;stroke:#2fbf71;stroke-width:2}"
    ".speed-0{stroke:#e5484d}.speed-1{stroke:#f2803a}.speed-2{stroke:#f2c53d}"
    ".speed-3{stroke:#9ccc3c}.speed-4{stroke:#2fbf71}.speed-5{stroke:#1fb6c9}"
    "</style>"
)


@dataclass(frozen=True)
class Trajectory:
    """A line on a map: ``points`` (x, y) in metres in driving order. Raises ValueError.

    ``speeds`` (m/s, one a point) colours it in ``SPEED_CLASSES`` steps of ``scale`` (m/s, slow to fast). ``style``: a
    CSS class.
    """

    points: Sequence[Sequence[float]]
    speeds: Sequence[float] | None = None
    style: str = ""
    scale: tuple[float, float] = (0.0, TOP_SPEED_MPS)

    def __post_init__(self) -> None:
        if self.speeds is not None and len(self.speeds) != len(self.points):
            raise ValueError(f"{len(self.speeds)} speeds for {len(self.points)} points")
        if not all(character.isascii() and (character.isalnum() or character == "-") for character in self.style):
            raise ValueError(f"style must be one CSS word, not {self.style!r}")

    def strokes(self) -> list[tuple[int | None, Points]]:
        """(speed class or None, thinned points (n, 2)) pieces that join up, broken only where the car was reset."""
        points = np.array([point[:2] for point in self.points], dtype=np.float64).reshape(-1, 2)
        classes = self._classes()
        result: list[tuple[int | None, Points]] = []
        start = 0
        for end in range(1, len(points) + 1):
            broken = end == len(points) or not math.dist(points[end], points[end - 1]) <= JUMP_M
            if not broken and (classes is None or classes[end] == classes[start]):
                continue
            # A change of colour shares its point with the next piece; a reset does not.
            piece = points[start : end if broken else end + 1]
            if len(piece) > 1 and np.isfinite(piece).all():
                result.append((None if classes is None else classes[start], simplify(piece)))
            start = end
        return result

    def _classes(self) -> list[int] | None:
        if self.speeds is None:
            return None
        slow, fast = self.scale
        share = np.nan_to_num((np.asarray(self.speeds, dtype=np.float64) - slow) / max(fast - slow, 0.1))
        return np.clip((share * SPEED_CLASSES).astype(int), 0, SPEED_CLASSES - 1).tolist()


def simplify(points: Points, error_m: float = ERROR_M) -> Points:
    """The fewest of the points that the method of Douglas and Peucker keeps within ``error_m`` of all; ends stay."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    todo = [(0, len(points) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        a, step = points[first], points[last] - points[first]
        apart = points[first + 1 : last] - a
        square = float(step @ step)
        t = np.clip(apart @ step / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(apart))
        off = np.linalg.norm(apart - t[:, None] * step, axis=1)
        worst = int(off.argmax())
        if off[worst] > error_m:
            middle = first + 1 + worst
            keep[middle] = True
            todo += [(first, middle), (middle, last)]
    return points[keep]


def simplify_loop(points: Points, error_m: float = ERROR_M) -> Points:
    """:func:`simplify` for a closed line whose first point is not repeated; row 0 stays."""
    far = int(np.linalg.norm(points - points[0], axis=1).argmax())
    there = simplify(points[: far + 1], error_m)
    back = simplify(np.concatenate((points[far:], points[:1])), error_m)
    return np.concatenate((there[:-1], back[:-1]))


class BoxMark(NamedTuple):
    """A box on a map: its middle (m), heading (rad), half its length along the heading and half its width across (m),
    its number in the list (0: not drawn), the title for pointers and screen readers, and whether its place is
    invalid."""

    x: float
    y: float
    yaw: float
    half_length: float
    half_width: float
    number: int = 0
    title: str = ""
    wrong: bool = False


def box_corners(box: BoxMark, least_m: float) -> list[tuple[float, float]]:
    """The four corners of the box in metres, enlarged so that half its length is at least ``least_m`` on long
    tracks."""
    scale = max(1.0, least_m / box.half_length)
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    reach, side = scale * box.half_length, scale * box.half_width
    return [
        (box.x + a * cos - b * sin, box.y + a * sin + b * cos)
        for a, b in ((reach, side), (-reach, side), (-reach, -side), (reach, -side))
    ]


def lane_line(track: TrackGeometry, lane: str) -> Points:
    """The middle of the ``"inner"`` or ``"outer"`` lane, (n, 2) in metres, without repeating the first point of a
    loop."""
    count = max(8, round(track.length / LANE_STEP_M))
    places = range(count + track.is_open)
    return np.array([track.lane_centre(track.length * k / count, lane)[:2] for k in places])


def draw_svg(
    track: TrackGeometry,
    *,
    width: int | None = None,
    lines: Sequence[Trajectory] = (),
    boxes: Sequence[BoxMark] = (),
    lanes: bool = False,
    title: str | None = None,
    standalone: bool = False,
    marks: str = "",
    below_m: float = 0.0,
    line_m: float = 0.0,
) -> str:
    """The map: road with kerbs, centre line, finish and driving direction, then lines and boxes; with ``lanes`` their
    middles too.

    ``width``: in pixels, None so that the page's layout decides. ``title`` (default: the track's name) may come from a
    stranger and is escaped. ``standalone``: adds a small style. ``marks``: SVG of the caller in the map's coordinates
    (see :func:`svg_path`), drawn on top of the road; ``below_m``: room for it below the map. ``line_m``: laps begin and
    end so many metres after the finish line.
    """
    frame = _Frame(track)
    size = f' width="{width}"' if width else ""
    ring = "".join(frame.path(simplify_loop(line), closed=True) for line in reversed(track.outlines))
    loop = not track.is_open
    centre = frame.path(simplify_loop(track.centre) if loop else simplify(track.centre), closed=loop)
    finish_m = track.along(track.finish_m + line_m) if line_m else track.finish_m
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="track-map" role="img"{size} '
        f'viewBox="0 0 {_number(frame.width)} {_number(frame.height + below_m)}">',
        f"<title>{_text(track.name if title is None else title)}</title>",
        _STYLE if standalone else "",
        f'<path class="track-road" fill-rule="evenodd" {_THIN} d="{ring}"/>',
        f'<path class="track-kerb" fill="none" {_THIN} d="{_kerbs(frame, track)}"/>',
        f'<path class="track-centre" fill="none" {_THIN} d="{centre}"/>',
        *(_lane(frame, track, lane) for lane in LANES if lanes),
        *(_stroke(frame, points, speed, one.style) for one in lines for speed, points in one.strokes()),
        "" if loop else f'<path class="track-start" fill="none" {_THIN} d="{frame.path(_across(track, 0.0))}"/>',
        f'<path class="track-finish" fill="none" {_THIN} d="{frame.path(_across(track, finish_m))}"/>',
        f'<path class="track-arrow" fill="none" {_THIN} d="{frame.path(_arrow(track, line_m))}"/>',
    ]
    return "".join([*parts, marks, *(_box(frame, box) for box in boxes), "</svg>"])


def svg_path(track: TrackGeometry, points: Sequence[Sequence[float]] | Points, *, closed: bool = False) -> str:
    """The ``d`` of a path through ``points`` (x, y in metres) in the coordinates of :func:`draw_svg` of this track."""
    return _Frame(track).path(points, closed=closed)


def _kerbs(frame: "_Frame", track: TrackGeometry) -> str:
    """The inner border of every turn."""
    paths = []
    for first, turned in corners_of(track):
        is_left = float(turned.sum()) > 0
        metres = [STEP_M * (first + row) for row in np.linspace(0, len(turned), max(3, len(turned) // KERB_ROWS))]
        inner = [left if is_left else -right for left, right in map(track.half_widths_at, metres)]
        border = np.array([track.point_at(at, offset)[:2] for at, offset in zip(metres, inner, strict=True)])
        paths.append(frame.path(simplify(border, KERB_ERROR_M)))
    return "".join(paths)


def _across(track: TrackGeometry, metres: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The two ends of a line across the road, border to border."""
    left, right = track.half_widths_at(metres)
    return track.point_at(metres, left)[:2], track.point_at(metres, -right)[:2]


def _arrow(track: TrackGeometry, line_m: float = 0.0) -> list[tuple[float, float]]:
    """Three points of a chevron after the start (moved by ``line_m``) that points in the driving direction."""
    size = _mark_size(track)
    reach = min(size, 0.4 * track.width_at(line_m))
    x, y, heading = track.point_at(line_m + 2.5 * size)
    cos, sin = math.cos(heading), math.sin(heading)
    return [(x + a * cos - b * sin, y + a * sin + b * cos) for a, b in ((-size, reach), (0.0, 0.0), (-size, -reach))]


def _mark_size(track: TrackGeometry) -> float:
    """Metres of a mark that is seen on a small map: grows with the map."""
    x_min, y_min, x_max, y_max = track.bounds
    return max(0.2, 0.022 * max(x_max - x_min, y_max - y_min))


class _Frame:
    """The map's coordinates: metres from the upper left corner, y down."""

    def __init__(self, track: TrackGeometry) -> None:
        x_min, y_min, x_max, y_max = track.bounds
        self.left, self.top = x_min - MARGIN_M, y_max + MARGIN_M
        self.width, self.height = x_max - x_min + 2 * MARGIN_M, y_max - y_min + 2 * MARGIN_M
        self.mark_m = _mark_size(track)

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
