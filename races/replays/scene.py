"""The scene document: a track as the viewer draws it, in metres and degrees of its own frame."""

import math
from typing import Any

from paddock.analysis.turns import turns_of
from paddock.geometry.checks import Points
from tracks.models import Track

SCENE_FORMAT = 2


def scene_document(track: Track, direction: str) -> dict[str, Any]:
    """The lines of a track in driving order, an open one's with its road before the start and beyond the finish.
    ``start`` and ``finish``: the middle of their line, its heading and the road's width there."""
    geometry = track.geometry.in_direction(direction)
    centre, inner, outer = geometry.lines
    if geometry.is_open:
        outer = outer[::-1]  # the line around an open road comes back along it
    return {
        "track": track.slug,
        "name": track.name,
        "direction": direction,
        "closed": not geometry.is_open,
        "length": round(geometry.length, 4),
        "width": round(float(geometry.half_widths.sum(axis=1).mean()), 4),
        "bounds": [round(each, 4) for each in geometry.bounds],
        "centre": _points(centre),
        "inner": _points(inner),
        "outer": _points(outer),
        "start": _line_across(geometry, 0.0),
        "finish": _line_across(geometry, geometry.finish_m),
        "turns": [turn._asdict() for turn in turns_of(track.geometry, direction)],
    }


def _points(line: Points) -> list[list[float]]:
    return [[round(x, 4), round(y, 4)] for x, y in line.tolist()]


def _line_across(geometry: Any, metres: float) -> dict[str, float]:
    x, y, yaw = geometry.point_at(metres)
    return {
        **{"x": round(x, 4), "y": round(y, 4), "yaw": round(math.degrees(yaw), 2)},
        "width": round(geometry.width_at(metres), 4),
    }
