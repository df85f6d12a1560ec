"""Rewards on the map: a heat map of one function, or of the difference of two, as SVG.

Colours: viridis (matplotlib, CC0) from low to high; blue, grey, orange below, at and above zero for a difference. Both
are readable without red and green, and by lightness alone.
"""

import math
from collections.abc import Sequence
from itertools import chain, repeat, zip_longest
from xml.sax.saxutils import escape

import numpy as np

from paddock.geometry.track import TrackGeometry
from tracks.drawing.maps import JUMP_M, MARGIN_M, draw_svg, svg_path

from ..sandbox.function import Params

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
    values: Sequence[Value],
    *,
    label: str = "reward",
    title: str | None = None,
    scale: tuple[float, float] | None = None,
    anchors: Sequence[str] = _VIRIDIS,
) -> str:
    """The values at the points of a drive, drawn over the track, with a legend.

    ``track`` in the driven direction. A point without a value (None) is drawn dashed and grey. ``scale``: the values
    of the first and the last colour, so that two maps can be compared; without, :func:`scale_of` the values.
    ``label``: the name of the values; ``title``: the text for screen readers; the caller translates both.
    """
    scale = scale or scale_of(values)
    points = [(state["x"], state["y"]) for state in states]
    colours = colours_of(anchors)
    pieces = list(_pieces(points))
    parts = [_outline(track, pieces)]
    labels: list[str] = []
    runs: list[tuple[str, list[tuple[float, float]]]] = []  # of one colour, so that no seams show
    for state, piece, value in zip(states, pieces, chain(values, repeat(None)), strict=False):
        if piece is None:
            continue
        colour = _UNKNOWN if value is None else colours[class_of(value, scale)]
        if runs and runs[-1][0] == colour and runs[-1][1][-1] == piece[0]:
            runs[-1][1].extend(piece[1:])
        else:
            runs.append((colour, list(piece)))
        shown = "?" if value is None else number(value)
        labels.append(
            f'<path class="heat-point" fill="none" stroke="#000000" stroke-opacity="0" stroke-width="12" {_THIN} '
            f'pointer-events="stroke" d="{svg_path(track, piece)}">'
            f"<title>{state['projection_distance']:.1f} m: {shown}</title></path>"
        )
    for colour, run in runs:
        dashes = ' stroke-dasharray="1 4"' if colour == _UNKNOWN else ""
        parts.append(
            f'<path class="heat" fill="none" stroke="{colour}" stroke-width="6"{dashes} stroke-linejoin="round" '
            f'{_THIN} d="{svg_path(track, run)}"/>'
        )
    legend, height = _legend(track, colours, values, scale, label)
    return draw_svg(track, title=title, marks="".join([*parts, *labels, legend]), below_m=height)


def difference_map(
    track: TrackGeometry, states: Sequence[Params], before: Sequence[Value], after: Sequence[Value], **texts: str
) -> str:
    """Where the second function gives more than the first (orange), and where less (blue), as :func:`heat_map`."""
    changes = differences(before, after)
    most = max(map(abs, scale_of(changes)))
    return heat_map(track, states, changes, scale=(-most, most), anchors=_DIVERGING, **{"label": "difference"} | texts)


def differences(before: Sequence[Value], after: Sequence[Value]) -> list[Value]:
    """After minus before, point by point; None where one of them has none, up to the longer one's end."""
    return [None if old is None or new is None else new - old for old, new in zip_longest(before, after)]


def scale_of(values: Sequence[Value]) -> tuple[float, float]:
    """Least and greatest value, of many values without the outer 2 % at either end; (0, 0) without values."""
    known = sorted(value for value in values if value is not None)
    if not known:
        return 0.0, 0.0
    cut = int(_OUTLIERS * len(known)) if len(known) >= _MANY else 0
    return known[cut], known[len(known) - 1 - cut]


def colours_of(anchors: Sequence[str], count: int = CLASSES) -> list[str]:
    rgb = np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in anchors])
    places = np.linspace(0, len(rgb) - 1, count)
    mixed = [np.interp(places, range(len(rgb)), channel).round().astype(int) for channel in rgb.T]
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in zip(*mixed, strict=True)]


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
