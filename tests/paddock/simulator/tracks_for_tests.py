"""Small tracks made by hand, so that these tests depend on no catalogue."""

from __future__ import annotations

import math

import numpy as np

from paddock.geometry.track import TrackGeometry


def stadium(straight: float = 4.0, radius: float = 1.2, width: float = 1.0, spacing: float = 0.1) -> TrackGeometry:
    """Two straights along x and two half circles, driven counter-clockwise; the finish is in the middle of the lower
    straight."""
    half = straight / 2
    points = [(x, -radius) for x in np.arange(0, half, spacing)]
    turn = math.pi * np.arange(0, 1, spacing / (math.pi * radius))
    points += [(half + radius * math.sin(a), -radius * math.cos(a)) for a in turn]
    points += [(x, radius) for x in np.arange(half, -half, -spacing)]
    points += [(-half - radius * math.sin(a), radius * math.cos(a)) for a in turn]
    points += [(x, -radius) for x in np.arange(-half, -spacing / 2, spacing)]
    return _road("stadium", np.array(points), width)


def hairpin(gap: float = 0.04, width: float = 0.6, straight: float = 6.0) -> TrackGeometry:
    """Like :func:`stadium`, but its two straights lie side by side, ``gap`` metres of field between them."""
    return stadium(straight, (width + gap) / 2, width, spacing=0.05)


def _road(name: str, centre: np.ndarray, width: float) -> TrackGeometry:
    along = np.roll(centre, -1, axis=0) - np.roll(centre, 1, axis=0)
    left = np.column_stack((-along[:, 1], along[:, 0])) / np.linalg.norm(along, axis=1)[:, None]
    return TrackGeometry.from_arrays(name, centre, centre + left * width / 2, centre - left * width / 2)
