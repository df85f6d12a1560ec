"""Measures a car's progress along the track and counts laps that were really driven."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from paddock.geometry.track import Projection, TrackGeometry

STRIDE_M = 0.3  # the greatest move of the nose in a control step: 4 m/s for 1/15 s and the swing of a turn
_SAMPLE_M = 0.05
_MARGIN = 1.5  # the nose may hang over a border while a wheel is still on the road
_WINDOW_M = 2.0  # the greatest distance between two projections along the track


class Reach:
    """The greatest distance along the centre line that one stride on the road can gain, by waypoint: about a stride,
    more inside a hairpin. A larger jump of the projection means that the car left this part of the track."""

    def __init__(self, track: TrackGeometry) -> None:
        count = max(8, int(np.ceil(track.length / _SAMPLE_M)))
        step = track.length / count
        along = np.arange(count) * step
        left, right = track.half_widths_along(along)
        gain = np.full(count, STRIDE_M)
        for offsets in (left, -right):
            points = track.points_at(along, offsets)
            lags = min(count // 2, int(_WINDOW_M / step))
            around = np.concatenate((points, points[:lags]))
            for lag in range(1, lags + 1):
                near = np.linalg.norm(around[lag : lag + count] - points, axis=1) <= STRIDE_M
                # Both ends of such a pair may be where the stride starts.
                near |= np.concatenate((near[-lag:], near[:-lag]))
                np.maximum(gain, lag * step, out=gain, where=near)
        # a projection names the segment only
        spread = int(np.ceil(2 * STRIDE_M / step))
        wide = sliding_window_view(np.pad(gain, spread, mode="wrap"), 2 * spread + 1).max(axis=1)
        index = np.minimum((track.cumulative / step).astype(int), count - 1)
        self.gains: list[float] = (_MARGIN * wide[index]).tolist()  # metres from each segment


def clear_distance(track: TrackGeometry) -> float:
    """Metres round the centre line within which every point is on the road: the least distance to a border. Lines of an
    open track count as closed, which never gives more room."""
    centre, *borders = track.lines
    return min(min(_least_distance(centre, border), _least_distance(border, centre)) for border in borders)


def _least_distance(points: np.ndarray, line: np.ndarray) -> float:
    """Least distance in metres of any of ``points`` (N, 2) to a closed polyline (M, 2)."""
    along = np.roll(line, -1, axis=0) - line
    square = np.maximum((along**2).sum(axis=1), 1e-12)  # borders stand still at the inside of a tight corner
    to_x, to_y = points[:, None, 0] - line[:, 0], points[:, None, 1] - line[:, 1]
    share = np.clip((to_x * along[:, 0] + to_y * along[:, 1]) / square, 0.0, 1.0)
    return float(np.sqrt(((to_x - share * along[:, 0]) ** 2 + (to_y - share * along[:, 1]) ** 2).min()))


class Odometer:
    """Unwrapped progress of one car's nose. ``metres``: from the finish line at the start of the run; the second lap
    begins at one track length, also on an open track. It falls when the car reverses."""

    def __init__(self, track: TrackGeometry, reach: Reach) -> None:
        self._track = track
        self.gains = reach.gains
        self.metres = 0.0
        self.place: Projection = track.project(*track.point_at(0.0)[:2])
        self.seen = self.place  # the last projection, credited or not
        self._patience = 1

    def put(self, x: float, y: float, near_m: float) -> None:
        """The car was placed with its nose at (x, y), about ``near_m`` metres (unwrapped) along the track."""
        hint = self._track.project(*self._track.point_at(self._track.along(near_m))[:2]).index
        self.place = self.seen = self._track.project(x, y, hint)
        self.metres = near_m + self._wrap(self.place.distance - near_m)
        self._patience = 1

    def move(self, x: float, y: float) -> bool:
        """The nose is at (x, y) after one control step; False, and nothing credited, where the car cannot have driven
        there along this road."""
        before, _, _, index = self.place
        track = self._track
        place = self.seen = track.project(x, y, index)
        gained = place[0] - before
        if not track.is_open:
            length = track.length  # _wrap, written out for speed
            gained = (gained + length / 2) % length - length / 2
        if abs(gained) > self._patience * self.gains[index]:
            self._patience += 1  # a nose that hung over the inside of a hairpin may catch up
            return False
        self._patience = 1
        self.metres += gained
        self.place = place
        return True

    def settle(self, metres: float, place: Projection) -> None:
        """The nose moved here in credited steps."""
        self.metres, self.place, self.seen = metres, place, place
        self._patience = 1

    def _wrap(self, metres: float) -> float:
        length = self._track.length
        return (metres + length / 2) % length - length / 2
