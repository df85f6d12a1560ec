"""Rewards on the map: a heat map of one function, and of the difference of two, as SVG.

Colours: viridis (matplotlib, CC0) from low to high, and blue, grey, orange below, at and above zero for a difference:
both can be told apart without red and green, and by lightness alone. The same input gives the same picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.sax.saxutils import escape

from paddock.geometry.track import TrackGeometry
from tracks.drawing.svg import MARGIN_M, draw_svg, svg_path
from tracks.drawing.trajectories import JUMP_M

from .function import Params

_VIRIDIS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725")
_DIVERGING = ("#1a4f8c", "#5a9bd4", "#d9d9d9", "#f0a35e", "#a84d00")
CLASSES = 21  # odd: a difference of nothing has the colour in the middle
_OUTLIERS = 0.02  # share of the values at either end that may lie beyond the scale
_MANY = 50  # below so many values none is left out of the scale

_UNKNOWN = "#8b949e"
_THIN = 'vector-effect="non-scaling-stroke"'

Value = float | None


def heat_map(
    track: TrackGeometry,
    states: Sequence[Params],
    rewards: Sequence[Value],
    *,
    label: str = "reward",
    title: str | None = None,
    scale: tuple[float, float] | None = None,
) -> str:
    """The rewards at the points of a drive, drawn over the track, with a legend.

    ``track`` in the driven direction. A point without a reward (None) is drawn dashed and grey. ``scale``: the values
    of the first and the last colour, so that two maps can be compared; without, :func:`scale_of` the rewards.
    ``label``: what the values are, and ``title``: what a screen reader says, both translated by the caller.
    """
    return _map(track, states, rewards, _VIRIDIS, scale or scale_of(rewards), label, title)


def difference_map(
    track: TrackGeometry,
    states: Sequence[Params],
    before: Sequence[Value],
    after: Sequence[Value],
    *,
    label: str = "difference",
    title: str | None = None,
) -> str:
    """Where the second function gives more than the first (orange), and where less (blue), as :func:`heat_map`."""
    changes = differences(before, after)
    low, high = scale_of(changes)
    most = max(abs(low), abs(high))
    return _map(track, states, changes, _DIVERGING, (-most, most), label, title)


def differences(before: Sequence[Value], after: Sequence[Value]) -> list[Value]:
    """After minus before, point by point; None where one of them has none, up to the longer one's end."""
    count = max(len(before), len(after))
    pairs = zip(_padded(before, count), _padded(after, count), strict=True)
    return [None if old is None or new is None else new - old for old, new in pairs]


def scale_of(values: Sequence[Value]) -> tuple[float, float]:
    """Least and greatest value; of many values without the outer 2 % at either end, so that one great reward at the
    finish does not make everything else look alike. (0, 0) without values."""
    known = sorted(value for value in values if value is not None)
    if not known:
        return 0.0, 0.0
    cut = int(_OUTLIERS * len(known)) if len(known) >= _MANY else 0
    return known[cut], known[len(known) - 1 - cut]


def colours_of(anchors: Sequence[str], count: int = CLASSES) -> list[str]:
    """``count`` colours evenly along the anchors (``#rrggbb``)."""
    rgb = [tuple(int(colour[at : at + 2], 16) for at in (1, 3, 5)) for colour in anchors]
    colours = []
    for number in range(count):
        place = number * (len(rgb) - 1) / (count - 1)
        index = min(int(place), len(rgb) - 2)
        mixed = (
            round(first + (place - index) * (second - first))
            for first, second in zip(rgb[index], rgb[index + 1], strict=True)
        )
        colours.append("#" + "".join(f"{part:02x}" for part in mixed))
    return colours


def _map(
    track: TrackGeometry,
    states: Sequence[Params],
    values: Sequence[Value],
    anchors: Sequence[str],
    scale: tuple[float, float],
    label: str,
    title: str | None,
) -> str:
    points = [(state["x"], state["y"]) for state in states]
    colours = colours_of(anchors)
    pieces = list(_pieces(points))
    parts = [_outline(track, pieces)]
    told: list[str] = []
    runs: list[tuple[str, list[tuple[float, float]]]] = []  # of one colour, so that no seams show
    for index, piece in enumerate(pieces):
        if piece is None:
            continue
        value = values[index] if index < len(values) else None
        colour = _UNKNOWN if value is None else colours[class_of(value, scale)]
        if runs and runs[-1][0] == colour and runs[-1][1][-1] == piece[0]:
            runs[-1][1].extend(piece[1:])
        else:
            runs.append((colour, list(piece)))
        distance = states[index]["projection_distance"]
        said = "?" if value is None else number(value)
        told.append(
            f'<path class="heat-point" fill="none" stroke="#000000" stroke-opacity="0" stroke-width="12" {_THIN} '
            f'pointer-events="stroke" d="{svg_path(track, piece)}"><title>{distance:.1f} m: {said}</title></path>'
        )
    for colour, run in runs:
        dashes = ' stroke-dasharray="1 4"' if colour == _UNKNOWN else ""
        parts.append(
            f'<path class="heat" fill="none" stroke="{colour}" stroke-width="6"{dashes} stroke-linejoin="round" '
            f'{_THIN} d="{svg_path(track, run)}"/>'
        )
    parts += told
    legend, height = _legend(track, colours, values, scale, label)
    return draw_svg(track, title=title, marks="".join(parts) + legend, below_m=height)


def _outline(track: TrackGeometry, pieces: Sequence[Sequence[Sequence[float]] | None]) -> str:
    """A pale edge under the line: its darkest colour is seen on a dark page and its brightest on a bright one."""
    path = "".join(svg_path(track, piece) for piece in pieces if piece is not None)
    return (
        f'<path class="heat-edge" fill="none" stroke="#ffffff" stroke-width="9" stroke-linejoin="round" '
        f'stroke-linecap="round" {_THIN} d="{path}"/>'
        f'<path class="heat-edge" fill="none" stroke="#3a3f45" stroke-width="7.5" stroke-linejoin="round" '
        f'stroke-linecap="round" {_THIN} d="{path}"/>'
    )


def _pieces(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]] | None]:
    """For each point the line from half-way before it to half-way after it; None for one that stands alone."""
    pieces: list[list[tuple[float, float]] | None] = []
    for index, here in enumerate(points):
        piece = [here]
        if index and math.dist(points[index - 1], here) <= JUMP_M:
            piece.insert(0, _between(points[index - 1], here))
        if index + 1 < len(points) and math.dist(points[index + 1], here) <= JUMP_M:
            piece.append(_between(here, points[index + 1]))
        pieces.append(piece if len(piece) > 1 else None)
    return pieces


def _between(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


def class_of(value: float, scale: tuple[float, float]) -> int:
    """The number of a value's colour, 0 to ``CLASSES`` - 1; the middle one where all values are the same."""
    low, high = scale
    if high <= low:
        return CLASSES // 2 if value == low else CLASSES - 1 if value > low else 0
    return min(max(int((value - low) / (high - low) * CLASSES), 0), CLASSES - 1)


def number(value: float) -> str:
    """A value for people: three digits that count, a real minus sign."""
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")


def _legend(
    track: TrackGeometry, colours: Sequence[str], values: Sequence[Value], scale: tuple[float, float], label: str
) -> tuple[str, float]:
    """The bar of colours with its values, below the map; and the height that it takes."""
    x_min, y_min, x_max, y_max = track.bounds
    wide, high = x_max - x_min, y_max - y_min
    size = 0.035 * max(wide, high)
    top, bar = high + 2 * MARGIN_M + 0.6 * size, 0.6 * wide
    left = MARGIN_M + (wide - bar) / 2
    width = bar / len(colours)
    parts = [
        f'<rect x="{left + index * width:.3f}" y="{top:.3f}" width="{width * 1.02:.3f}" height="{size:.3f}" '
        f'fill="{colour}"/>'
        for index, colour in enumerate(colours)
    ]
    known = [value for value in values if value is not None]
    low, most = scale
    below, above = any(value < low for value in known), any(value > most for value in known)
    texts = [
        (left, "start", ("≤ " if below else "") + number(low)),
        (left + bar / 2, "middle", number((low + most) / 2) if most > low else ""),
        (left + bar, "end", ("≥ " if above else "") + number(most)),
    ]
    if low == most and not below and not above:  # the same everywhere: one colour, one number
        texts = [(left + bar / 2, "middle", number(abs(most) if most == 0 else most))]
    parts += [
        f'<text x="{x:.3f}" y="{top + 2.1 * size:.3f}" text-anchor="{anchor}" font-size="{size:.3f}" '
        f'fill="currentColor">{text}</text>'
        for x, anchor, text in texts
        if known and text
    ]
    parts.append(
        f'<text x="{left + bar / 2:.3f}" y="{top + 3.4 * size:.3f}" text-anchor="middle" font-size="{size:.3f}" '
        f'fill="currentColor">{escape(label)}</text>'
    )
    return f'<g class="heat-legend">{"".join(parts)}</g>', 4.6 * size


def _padded(values: Sequence[Value], count: int) -> list[Value]:
    return [*values, *[None] * (count - len(values))]
