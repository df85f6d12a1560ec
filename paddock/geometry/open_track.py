"""The geometry of open tracks, which cars drive from the first waypoint to the last."""

import math

import numpy as np

from paddock.errors import UserFault

from .checks import Floats, Points, check_way, check_widths, cross, find_crossing, inside
from .track import CCW, CW, Projection, TrackGeometry, frozen

RUN_OFF_M = 0.5  # of road before the start and beyond the finish
_EARLY_M = 0.05  # so near to the end, metres are the next lap's start


class OpenTrack(TrackGeometry):
    """A road that every lap drives from its first waypoint to its last. It goes straight on for ``RUN_OFF_M`` beyond
    both ends; ``outlines`` holds the one line round all of it. ``direction``: ``"ccw"`` with the inner border on the
    left."""

    is_open = True

    @staticmethod
    def check(centre: Points, inner: Points, outer: Points) -> None:
        """Refuse open lines that are no road, as :func:`.checks.check_road`. Raises UserFault."""
        check_way(centre, np.diff(centre, axis=0))
        check_widths(inner, outer)
        around = outline(centre, inner, outer)
        for line, is_open in ((around, False), (centre, True)):
            found = find_crossing(line, None if line is around else around, is_open)
            if found is not None:
                names = [_border_at(row, len(centre)) for row in found]
                if is_open:
                    names[0] = ("centre line", found[0])
                (name, row), (other, other_row) = names
                raise UserFault("track_borders_cross", line=name, row=row, other_line=other, other_row=other_row)
        if runs_left(centre, inner) == runs_left(centre, outer) or not inside(around, centre[0]):
            raise UserFault("track_borders_apart")

    @property
    def finish_m(self) -> float:
        return self.length

    @property
    def lines(self) -> tuple[Points, Points, Points]:
        count = len(self.centre) + 2
        (around,), (middle,) = self.outlines, self.middles
        return middle[:count], around[:count], around[count:]

    def _direction(self) -> str:
        return CCW if runs_left(self.centre, self.inner) else CW

    @staticmethod
    def _leads(line: Points) -> Points:
        return np.diff(line, axis=0)

    def _enclose(self) -> None:
        put = self.__dict__
        put["outlines"] = (frozen(outline(self.centre, self.inner, self.outer)),)
        put["middles"] = (frozen(outline(self.centre, self.centre, self.centre)),)
        put["paved"], put["_turn"] = (-RUN_OFF_M, self.length + RUN_OFF_M), math.inf

    @staticmethod
    def _tangents(unit: Points) -> Points:
        tangents = np.vstack((unit[:1], unit[1:] + unit[:-1], unit[-1:]))
        return tangents / np.linalg.norm(tangents, axis=1)[:, None]

    def _border(self, border: Points) -> tuple[Points, Points]:
        line = go_on(self.centre, border)
        return line[:-1], self._leads(line)

    @staticmethod
    def _reversed(line: Points) -> Points:
        return line[::-1]

    def along(self, metres: float) -> float:
        """Metres from the start for those of a run of many laps."""
        return metres - math.floor((metres + _EARLY_M) / self.length) * self.length

    def project(self, x: float, y: float, hint: int | None = None) -> Projection:
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"cannot project a point that is not finite: ({x}, {y})")
        return self._settle(x, y, self._nearest(x, y) if hint is None else self._nearest_about(x, y, hint))

    def point_at(self, distance: float, offset: float = 0.0) -> tuple[float, float, float]:
        """As on a loop, but straight on before the start and beyond the end."""
        x, y, heading = super().point_at(distance, offset)
        beyond = min(distance, 0.0) + max(distance - self.length, 0.0)
        return x + beyond * math.cos(heading), y + beyond * math.sin(heading), heading

    def points_at(self, distances: Floats, offsets: Floats | float = 0.0) -> Points:
        points = super().points_at(distances, offsets)
        distances = np.asarray(distances, np.float64)
        before, after = np.minimum(distances, 0.0), np.maximum(distances - self.length, 0.0)
        first, last = ((math.cos(yaw), math.sin(yaw)) for yaw in (self._ends()))
        return points + before[:, None] * first + after[:, None] * last

    def _ends(self) -> tuple[float, float]:
        return super().point_at(0.0)[2], super().point_at(self.length)[2]

    def _place(self, distance: float) -> tuple[int, float]:
        if not math.isfinite(distance):
            raise ValueError(f"distance must be finite, not {distance}")
        return super()._place(min(max(distance, 0.0), self.length))

    def _places(self, distances: Floats) -> tuple[np.ndarray, Points]:
        return super()._places(np.clip(np.asarray(distances, np.float64), 0.0, self.length))

    def _settle(self, x: float, y: float, nearest: int) -> Projection:
        for index, metres, heading in zip((0, len(self._segments) - 1), (0.0, self.length), self._ends(), strict=True):
            end = self.centre[0 if metres == 0.0 else -1]
            dx, dy = x - float(end[0]), y - float(end[1])
            cos, sin = math.cos(heading), math.sin(heading)
            beyond = dx * cos + dy * sin
            if nearest == index and (beyond >= 0.0 if metres else beyond < 0.0):
                return Projection(metres + beyond, dy * cos - dx * sin, heading, index)
        return super()._settle(x, y, nearest)


TrackGeometry._open = OpenTrack


def go_on(centre: Points, line: Points) -> Points:
    """(N + 2, 2): the centre line, or a line beside it, extended by ``RUN_OFF_M`` at both ends."""
    first, last = centre[1] - centre[0], centre[-1] - centre[-2]
    before = line[0] - first * (RUN_OFF_M / np.linalg.norm(first))
    after = line[-1] + last * (RUN_OFF_M / np.linalg.norm(last))
    return np.vstack((before, line, after))


def outline(centre: Points, inner: Points, outer: Points) -> Points:
    """(2 N + 4, 2): the closed line round the road, along the inner border and back along the outer one."""
    return np.vstack((go_on(centre, inner), go_on(centre, outer)[::-1]))


def runs_left(centre: Points, border: Points) -> bool:
    """Whether a border lies to the left of the first point, in the order of the rows."""
    return bool(cross(centre[1] - centre[0], border[0] - centre[0]) > 0)


def _border_at(row: int, count: int) -> tuple[str, int]:
    """The border and the waypoint of a row of the outline."""
    if row < count + 2:
        return "inner border", min(max(row - 1, 0), count - 1)
    return "outer border", min(max(2 * count + 2 - row, 0), count - 1)
