"""Drawings of the league as SVG, made on the server: no script, and the page's own colours by their classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import log10

WIDTH, HEIGHT = 430, 210
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 14, 30


@dataclass(frozen=True)
class ChartPoint:
    """One result of a racer. ``series``: what it is joined to by a line; ``label``: below it; ``title``: in words."""

    rank: int
    series: str
    label: str
    title: str


def progress_chart(points: Sequence[ChartPoint], *, title: str) -> str:
    """Ranks over a season as an SVG, the first rank on top, on a logarithmic scale: from 2,000th to 20th shows as much
    as from 20th to the front. ``points``: in the order of time, at least one."""
    worst = max(10, *(point.rank for point in points))
    decades = 10 ** int(log10(worst) + 0.999)
    step = (WIDTH - LEFT - RIGHT) / len(points)

    def x(index: int) -> float:
        return LEFT + step * (index + 0.5)

    def y(rank: int) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * log10(rank) / log10(decades)

    parts = [f'<svg class="progress-chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">']
    mark = 1
    while mark <= decades:
        parts.append(f'<path class="chart-grid" d="M{LEFT} {y(mark):.1f}H{WIDTH - RIGHT}"/>')
        parts.append(f'<text class="chart-scale" x="{LEFT - 8}" y="{y(mark) + 4:.1f}">{mark}</text>')
        mark *= 10
    for series in dict.fromkeys(point.series for point in points):
        own = [(index, point) for index, point in enumerate(points) if point.series == series]
        path = "L".join(f"{x(index):.1f} {y(point.rank):.1f}" for index, point in own)
        parts.append(f'<path class="chart-line {escape(series)}" d="M{path}"/>')
    for index, point in enumerate(points):
        place = f'cx="{x(index):.1f}" cy="{y(point.rank):.1f}"'
        parts.append(
            f'<circle class="chart-point {escape(point.series)}" {place} r="5">'
            f"<title>{escape(point.title)}</title></circle>"
        )
        parts.append(f'<text class="chart-label" x="{x(index):.1f}" y="{HEIGHT - 9}">{escape(point.label)}</text>')
    parts.append("</svg>")
    return "".join(parts)
