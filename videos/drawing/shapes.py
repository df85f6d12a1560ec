"""Shells from above and from the side as polygons, from the SVG paths of :mod:`evaluation.appearance.shells`."""

import re
from functools import cache
from typing import NamedTuple

import numpy as np

from evaluation.appearance.looks import Shell
from evaluation.appearance.shells import FROM_ABOVE, FROM_THE_SIDE, GROUND

UNIT_M = 0.33 / 120  # a unit of a shell from above
_TOKEN = re.compile(r"[MLHVQTZ]|-?(?:\d+\.?\d*|\.\d+)")
_CURVE = np.linspace(0.0, 1.0, 9)[1:, None]
_AXLE = 14.0  # the greatest width of a wheel; a wider shape is both wheels of an axle

Polygon = np.ndarray


def polygons(path: str) -> list[Polygon]:
    """The closed outlines of an SVG path of M, L, H, V, Q, T and Z in absolute coordinates, (n, 2) each.

    Raises ValueError for a path with anything else.
    """
    words = _TOKEN.findall(path)
    if "".join(words) != re.sub(r"[\s,]", "", path):
        raise ValueError(f"not a path of M, L, H, V, Q, T and Z: {path!r}")
    outlines: list[list[np.ndarray]] = []
    command, place, handle = "", np.zeros(2), None
    words.reverse()
    while words:
        if words[-1].isalpha():
            command = words.pop()
            if command == "Z":
                handle = None
                continue
        if command == "H":
            points, handle = [np.array((float(words.pop()), place[1]))], None
        elif command == "V":
            points, handle = [np.array((place[0], float(words.pop())))], None
        elif command in "QT":
            bend = _point(words) if command == "Q" else 2 * place - (place if handle is None else handle)
            points, handle = list(_curve(place, bend, _point(words))), bend
        else:
            points, handle = [_point(words)], None
        if command == "M":
            outlines.append([])
            command = "L"
        outlines[-1] += points
        place = points[-1]
    return [np.array(outline) for outline in outlines]


def _point(words: list[str]) -> np.ndarray:
    return np.array((float(words.pop()), float(words.pop())))


def _curve(start: np.ndarray, bend: np.ndarray, end: np.ndarray) -> np.ndarray:
    rest = 1.0 - _CURVE
    return rest * rest * start + 2.0 * rest * _CURVE * bend + _CURVE * _CURVE * end


class Above(NamedTuple):
    """A shell from above in metres around the middle of the car, x to the front, y to the left. ``steered``: the front
    wheels, each with its hub."""

    body: list[Polygon]
    glass: list[Polygon]
    dark: list[Polygon]
    under: list[Polygon]
    steered: list[tuple[Polygon, Polygon]]


@cache
def above(shell: str) -> Above:
    """The shell from above; Paddock's for an unknown word."""
    drawing = FROM_ABOVE.get(shell, FROM_ABOVE[Shell.PADDOCK])
    body, glass, dark, under = (
        [outline * (UNIT_M, -UNIT_M) for outline in polygons(path)]
        for path in (drawing.body, drawing.glass, drawing.dark, drawing.under)
    )
    fixed: list[Polygon] = []
    steered = []
    for part in under:
        if part[:, 0].mean() <= 0.0 or np.ptp(part[:, 0]) < _AXLE * UNIT_M:
            fixed.append(part)
            continue
        steered += [(wheel, wheel.mean(axis=0)) for wheel in _wheels(part)]
    foremost = max((centre[0] for _, centre in steered), default=0.0)
    fixed += [wheel for wheel, centre in steered if centre[0] < foremost - 0.02]
    return Above(body, glass, dark, fixed, [one for one in steered if one[1][0] >= foremost - 0.02])


def _wheels(part: Polygon) -> list[Polygon]:
    """The wheels of a shape: itself, or the two of an axle that is drawn in one piece."""
    if np.ptp(part[:, 1]) <= 2 * _AXLE * UNIT_M:
        return [part]
    (x0, y0), (x1, y1) = part.min(axis=0), part.max(axis=0)
    wide = _AXLE * UNIT_M
    return [
        np.array([(x0, low), (x1, low), (x1, high), (x0, high)]) for low, high in ((y0, y0 + wide), (y1 - wide, y1))
    ]


class Side(NamedTuple):
    """A shell from the side, 120 x 56 units, y down; ``wheels``: (x, y, radius) each."""

    body: list[Polygon]
    glass: list[Polygon]
    dark: list[Polygon]
    wheels: list[tuple[float, float, float]]


@cache
def side(shell: str) -> Side:
    """The shell from the side; Paddock's for an unknown word."""
    drawing = FROM_THE_SIDE.get(shell, FROM_THE_SIDE[Shell.PADDOCK])
    rear, front, radius = drawing.wheels
    wheels = [(x, GROUND - radius, radius) for x in (rear, front)]
    return Side(polygons(drawing.body), polygons(drawing.glass), polygons(drawing.dark), wheels)
