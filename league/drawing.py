"""Drawings of the league as SVG, made on the server: no script, and the page's own colours by their classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import log10

WIDTH, HEIGHT = 430, 210
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 14, 30
_CHARACTER_PX = 6.6  # of the badge's 11 px letters, on average


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


def badge(label: str, value: str, *, good: bool = True) -> str:
    """A badge image of two boxes, for pages elsewhere: its colours are its own. Any text is escaped and cut."""
    label, value = label[:40], value[:60]
    left, right = (round(14 + _CHARACTER_PX * _wide(text)) for text in (label, value))
    total, colour = left + right, "#0b7a43" if good else "#5c6876"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="22" viewBox="0 0 {total} 22" role="img" '
        f'aria-label="{escape(label)}: {escape(value)}"><title>{escape(label)}: {escape(value)}</title>'
        f'<clipPath id="r"><rect width="{total}" height="22" rx="4"/></clipPath><g clip-path="url(#r)">'
        f'<rect width="{left}" height="22" fill="#151a21"/>'
        f'<rect x="{left}" width="{right}" height="22" fill="{colour}"/>'
        f'</g><g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">'
        f'<text x="{left / 2:g}" y="15" textLength="{left - 12}">{escape(label)}</text>'
        f'<text x="{left + right / 2:g}" y="15" textLength="{right - 12}">{escape(value)}</text></g></svg>\n'
    )


def _wide(text: str) -> float:
    """Letters in the width of Latin ones: Hangul and Chinese are nearly twice as wide."""
    return sum(1.75 if ord(letter) > 0x2E80 else 1 for letter in text)
