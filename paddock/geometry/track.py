"""The one immutable description of a track: centre line, borders, distances and projection."""

# ``inner[i]`` and ``outer[i]`` lie across the road from ``centre[i]`` (deepracer-simapp, track_geom/track_data.py).
# Each waypoint has a tangent (the bisector of its two segments), a segment blends the tangents of its ends, and "across
# the track" is square to the blend. So distance, offset and heading are continuous, and ``project`` is the inverse of
# ``point_at`` wherever the road is not folded.

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from typing import Any, ClassVar, TypedDict

import numpy as np

from .checks import Floats, Points, check_road, clean_rows, ends_apart, inside, signed_area
from .road import Road
from .segments import ROUNDING_M, Projection, Segment, foot, reaches, root, segments

CCW = "ccw"
CW = "cw"
DIRECTIONS = (CCW, CW)

WINDOW_M = 2.0  # how far from the hint a projection may land, along the centre line


_made = tuple.__new__  # of a class and its values, without a call through Python


class TrackDocument(TypedDict):
    """A track in JSON, from which the same track is made to the last bit."""

    name: str
    centre: list[list[float]]
    inner: list[list[float]]
    outer: list[list[float]]


class TrackGeometry:
    """An immutable road, driven in the order of its rows. Build it with :meth:`from_arrays`; lines whose ends lie apart
    make an :class:`.open_track.OpenTrack`, all others a loop.

    ``centre``, ``inner``, ``outer``, ``left``, ``right``: float64 (N, 2), read-only; row 0 is the finish and is not
    repeated at the end. ``inner`` lies inside the loop; ``left`` and ``right`` are the same borders by driving
    direction. ``cumulative``: (N,) metres from the finish. ``outlines``: the closed lines around the road, and
    ``middles``: the centre point of each of their rows. ``paved``: the first and the last metre of the road.
    ``segment_rows``: (N, 13) the numbers of :class:`.segments.Segment` for each segment.
    """

    name: str
    centre: Points
    inner: Points
    outer: Points
    left: Points
    right: Points
    cumulative: Points
    length: float
    direction: str
    bounds: tuple[float, float, float, float]
    outlines: tuple[Points, ...]
    middles: tuple[Points, ...]
    paved: tuple[float, float]
    is_open = False
    _open: ClassVar[Any]  # :class:`.open_track.OpenTrack`, set by its module
    _turn: float  # the distance at which it begins again at 0
    _left_m: list[float]
    _right_m: list[float]
    _starts: list[float]
    _segments: list[Segment]
    segment_rows: Points
    _steps: Points
    road: Road

    def __new__(cls, name: str, centre: Points, inner: Points, outer: Points) -> TrackGeometry:
        return super().__new__(cls._open if ends_apart(centre) else cls)

    def __init__(self, name: str, centre: Points, inner: Points, outer: Points) -> None:
        """Take clean and checked rows; use :meth:`from_arrays` for all others."""
        put = self.__dict__
        put["name"] = name
        for line, rows in (("centre", centre), ("inner", inner), ("outer", outer)):
            put[line] = frozen(rows)
        put["direction"] = self._direction()
        put["left"], put["right"] = (self.inner, self.outer) if self.direction == CCW else (self.outer, self.inner)

        steps = self._leads(centre)
        lengths = np.linalg.norm(steps, axis=1)
        ends = np.cumsum(lengths)
        put["length"] = float(ends[-1])
        put["cumulative"] = frozen(np.concatenate(([0.0], ends))[: len(centre)])
        self._enclose()
        borders = np.vstack(self.outlines)
        low, high = borders.min(axis=0), borders.max(axis=0)
        put["bounds"] = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))

        tangents = self._tangents(steps / lengths[:, None])
        normals = np.column_stack((-tangents[:, 1], tangents[:, 0]))
        sides = ((normals, self.left), (-normals, self.right))
        left_m, right_m = (reaches(self.centre, across, border, *self._border(border)) for across, border in sides)
        put["_left_m"], put["_right_m"] = left_m.tolist(), right_m.tolist()
        put["_starts"] = self.cumulative.tolist()
        wide = np.maximum(left_m, right_m)
        put["_segments"] = list(segments(self.centre, tangents, self._starts, self.length, wide, len(steps)))
        put["segment_rows"] = frozen(np.array(self._segments))
        put["_steps"] = frozen(steps)
        put["road"] = Road(*self.outlines)

    def _direction(self) -> str:
        return CCW if signed_area(self.centre) > 0 else CW

    @staticmethod
    def _leads(line: Points) -> Points:
        """From each point of a line to the next."""
        return np.roll(line, -1, axis=0) - line

    def _enclose(self) -> None:
        put = self.__dict__
        put["outlines"], put["middles"] = (self.inner, self.outer), (self.centre, self.centre)
        put["paved"], put["_turn"] = (0.0, self.length), self.length

    @staticmethod
    def _tangents(unit: Points) -> Points:
        """Direction of the track at each waypoint, from those of the segments (unit vectors)."""
        tangents = unit + np.roll(unit, 1, axis=0)
        return tangents / np.linalg.norm(tangents, axis=1)[:, None]

    def _border(self, border: Points) -> tuple[Points, Points]:
        """The starts of a border's segments, and the steps to their ends."""
        return border, self._leads(border)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a track does not change: cannot set {name}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a track does not change: cannot delete {name}")

    @classmethod
    def from_arrays(
        cls,
        name: str,
        centre: Any,
        inner: Any,
        outer: Any,
        *,
        is_open: bool | None = False,
        is_known: bool = False,
    ) -> TrackGeometry:
        """Check three tables of points, each (N, 2) in metres, and build the track; repeated points are dropped, and
        exchanged borders are swapped. ``is_open``: whether it must be an open track, None for either; ``is_known``:
        these points have passed all checks before. Raises UserFault with a ``track_...`` code, see
        :mod:`paddock.geometry.checks`.
        """
        centre, inner, outer = clean_rows(centre, inner, outer, is_open)
        if ends_apart(centre):
            if not is_known:
                cls._open.check(centre, inner, outer)
            return cls(name, centre, inner, outer)
        if not is_known:
            check_road(centre, inner, outer)
        if not inside(outer, inner[0]):
            inner, outer = outer, inner
        return cls(name, centre, inner, outer)

    def in_direction(self, direction: str) -> TrackGeometry:
        """The same road driven ``"ccw"`` or ``"cw"`` from the same finish, an open one from its other end. Raises
        ValueError."""
        if direction not in DIRECTIONS:
            raise ValueError(f"direction must be one of {DIRECTIONS}, not {direction!r}")
        if direction == self.direction:
            return self
        return TrackGeometry(self.name, *(self._reversed(line) for line in (self.centre, self.inner, self.outer)))

    @staticmethod
    def _reversed(line: Points) -> Points:
        return np.concatenate((line[:1], line[:0:-1]))

    def along(self, metres: float) -> float:
        """Metres along this track for the unwrapped metres of a run."""
        return metres

    def project(self, x: float, y: float, hint: int | None = None) -> Projection:
        """The projection of the point (x, y). With ``hint``, the index of its last projection, only the track within
        ``WINDOW_M`` of it counts: fast, and right where parts of the track run side by side. Raises ValueError for a
        point that is not finite."""
        if hint is not None:
            segments = self._segments
            count = len(segments)
            index = hint % count
            walked = 0.0
            while True:
                ax, ay, ex, ey, tx, ty, ux, uy, along, bend, start, size, reach = segments[index]
                px = x - ax
                py = y - ay
                behind = px * tx + py * ty
                if behind < 0.0:
                    if behind < -ROUNDING_M:
                        if walked > 0.0 or walked < -WINDOW_M:
                            break
                        index = index - 1 if index else count - 1
                        walked -= size
                        continue
                    behind = 0.0
                slope = px * ux + py * uy - along
                if behind + slope - bend >= 0.0:
                    if walked < 0.0 or walked > WINDOW_M:
                        break
                    index += 1
                    if index == count:
                        index = 0
                    walked += size
                    continue
                # the root in [0, 1) of behind + slope t - bend t^2: the line across the track meets the point
                below = math.sqrt(slope * slope + 4.0 * behind * bend) - slope
                t = 2.0 * behind / below if below > 0.0 else 0.0
                tx += t * ux
                ty += t * uy
                offset = (tx * (py - t * ey) - ty * (px - t * ex)) / math.sqrt(tx * tx + ty * ty)
                if -reach <= offset <= reach:
                    distance = start + t * size
                    if distance >= self.length:
                        distance = 0.0
                    return _made(Projection, (distance, offset, math.atan2(ty, tx), index))
                break
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"cannot project a point that is not finite: ({x}, {y})")
        return self._settle(x, y, self._nearest(x, y) if hint is None else self._nearest_about(x, y, hint))

    def point_at(self, distance: float, offset: float = 0.0) -> tuple[float, float, float]:
        """(x, y, heading) of the point ``offset`` metres to the left of the centre line; ``distance`` wraps round."""
        index, t = self._place(distance)
        ax, ay, ex, ey, tx, ty, ux, uy, *_ = self._segments[index]
        tx += t * ux
        ty += t * uy
        scale = offset / math.sqrt(tx * tx + ty * ty)
        return ax + t * ex - ty * scale, ay + t * ey + tx * scale, math.atan2(ty, tx)

    def points_at(self, distances: Floats, offsets: Floats | float = 0.0) -> Points:
        """(N, 2): the points of :meth:`point_at` for many distances at once, to the last bit."""
        index, t = self._places(distances)
        ax, ay, ex, ey, tx, ty, ux, uy = self.segment_rows[index, :8].T
        tx = tx + t * ux
        ty = ty + t * uy
        scale = offsets / np.sqrt(tx * tx + ty * ty)
        return np.column_stack((ax + t * ex - ty * scale, ay + t * ey + tx * scale))

    def half_widths_along(self, distances: Floats) -> tuple[Points, Points]:
        """:meth:`half_widths_at` for many distances at once, to the last bit."""
        index, t = self._places(distances)
        after = (index + 1) % len(self._starts)
        left, right = np.array(self._left_m), np.array(self._right_m)
        return left[index] + t * (left[after] - left[index]), right[index] + t * (right[after] - right[index])

    def half_widths_at(self, distance: float) -> tuple[float, float]:
        """Metres from the centre line to the left and to the right border, square to the track."""
        index, t = self._place(distance)
        after = index + 1 if index + 1 < len(self._starts) else 0
        left, right = self._left_m, self._right_m
        return (
            left[index] + t * (left[after] - left[index]),
            right[index] + t * (right[after] - right[index]),
        )

    def width_at(self, distance: float) -> float:
        """Metres between the borders, square to the track."""
        left, right = self.half_widths_at(distance)
        return left + right

    def lane_centre(self, distance: float, lane: str) -> tuple[float, float, float]:
        """(x, y, heading) half-way between centre line and the ``"inner"`` or ``"outer"`` border (deepracer-simapp)."""
        if lane not in ("inner", "outer"):
            raise ValueError(f"lane must be 'inner' or 'outer', not {lane!r}")
        left, right = self.half_widths_at(distance)
        on_the_left = (lane == "inner") == (self.direction == CCW)
        return self.point_at(distance, left / 2 if on_the_left else -right / 2)

    def on_road(self, x: float, y: float) -> bool:
        """True where (x, y) lies between the borders or on a border line; exact, no hint needed."""
        return self.road.contains(x, y)

    @property
    def half_widths(self) -> Points:
        """(N, 2): metres from each waypoint to the left and to the right border."""
        return np.column_stack((self._left_m, self._right_m))

    @property
    def finish_m(self) -> float:
        """The distance from row 0 to the end of a lap, for drawings."""
        return 0.0

    @property
    def lines(self) -> tuple[Points, Points, Points]:
        """Centre, inner and outer border over the whole road."""
        return self.centre, self.inner, self.outer

    @property
    def fingerprint(self) -> str:
        """sha-256 (hex) of the little-endian float64 bytes of centre, inner and outer."""
        digest = hashlib.sha256()
        for line in (self.centre, self.inner, self.outer):
            digest.update(line.astype("<f8").tobytes())
        return digest.hexdigest()

    def to_dict(self) -> TrackDocument:
        centre, inner, outer = (line.tolist() for line in (self.centre, self.inner, self.outer))
        return {"name": self.name, "centre": centre, "inner": inner, "outer": outer}

    @classmethod
    def from_dict(cls, data: TrackDocument) -> TrackGeometry:
        """The track that :meth:`to_dict` wrote, checked again."""
        return cls.from_arrays(data["name"], data["centre"], data["inner"], data["outer"], is_open=None)

    @classmethod
    def from_trusted_dict(cls, data: TrackDocument) -> TrackGeometry:
        """As :meth:`from_dict` without the checks, which take 30 ms: for a document of our own processes."""
        return cls(data["name"], *(np.array(data[line], np.float64) for line in ("centre", "inner", "outer")))

    def __len__(self) -> int:
        return len(self._starts)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TrackGeometry):
            return NotImplemented
        return self.name == other.name and self.fingerprint == other.fingerprint

    def __hash__(self) -> int:
        return hash((self.name, self.fingerprint))

    def __repr__(self) -> str:
        return f"<TrackGeometry {self.name!r} {self.length:.2f} m {self.direction}, {len(self)} waypoints>"

    def __reduce__(self) -> tuple[Any, ...]:
        return TrackGeometry, (self.name, np.array(self.centre), np.array(self.inner), np.array(self.outer))

    def _place(self, distance: float) -> tuple[int, float]:
        """(segment, share of it) at any distance from the finish."""
        if not math.isfinite(distance):
            raise ValueError(f"distance must be finite, not {distance}")
        distance %= self._turn
        index = min(bisect_right(self._starts, distance), len(self._segments)) - 1
        start, size = self._segments[index][10:12]
        return index, min((distance - start) / size, 1.0)

    def _places(self, distances: Floats) -> tuple[np.ndarray, Points]:
        distances = np.asarray(distances, np.float64) % self._turn
        index = np.minimum(np.searchsorted(self.cumulative, distances, side="right"), len(self._segments)) - 1
        start, size = self.segment_rows[index, 10:12].T
        return index, np.minimum((distances - start) / size, 1.0)

    def _nearest(self, x: float, y: float) -> int:
        """The segment nearest to the point; the first of equals."""
        steps = self._steps
        apart = np.array((x, y)) - self.centre[: len(steps)]
        t = np.clip((apart * steps).sum(axis=1) / (steps * steps).sum(axis=1), 0.0, 1.0)
        apart -= t[:, None] * steps
        return int((apart * apart).sum(axis=1).argmin())

    def _nearest_about(self, x: float, y: float, hint: int) -> int:
        """The nearest segment within WINDOW_M of ``hint``; of equals the one nearest to the hint."""
        count = len(self._segments)
        best = index = hint % count
        least, _ = foot(self._segments[index], x, y)
        for step in (1, -1):
            walked, index = 0.0, hint % count
            while walked < WINDOW_M:
                index += step
                if not 0 <= index < count:
                    if self.is_open:
                        break
                    index %= count
                square, _ = foot(self._segments[index], x, y)
                if square < least:
                    least, best = square, index
                walked += self._segments[index][11]
        return best

    def _settle(self, x: float, y: float, nearest: int) -> Projection:
        """The projection of a point whose nearest segment is known: across the blended direction if that is near the
        nearest point, else (inside a tight corner) the nearest point itself."""
        square, share = foot(self._segments[nearest], x, y)
        limit = 1.2 * math.sqrt(square) + 0.02
        count = len(self._segments)
        for index in (nearest, (nearest - 1) % count, (nearest + 1) % count):
            t = root(self._segments[index], x, y)
            if t is not None:
                found = self._seen_from(index, t, x, y)
                if abs(found.offset) <= limit:
                    return found
        found = self._seen_from(nearest, share, x, y)
        return Projection(found.distance, math.copysign(math.sqrt(square), found.offset), found.heading, found.index)

    def _seen_from(self, index: int, t: float, x: float, y: float) -> Projection:
        ax, ay, ex, ey, tx, ty, ux, uy, _, _, start, size, _ = self._segments[index]
        tx += t * ux
        ty += t * uy
        offset = (tx * (y - ay - t * ey) - ty * (x - ax - t * ex)) / math.sqrt(tx * tx + ty * ty)
        distance = start + t * size
        return Projection(distance if distance < self._turn else 0.0, offset, math.atan2(ty, tx), index)


def frozen(rows: Points) -> Points:
    rows = np.array(rows, dtype=np.float64, order="C")
    rows.flags.writeable = False
    return rows


from . import open_track as open_track  # noqa: E402  registers itself with TrackGeometry, which it imports
