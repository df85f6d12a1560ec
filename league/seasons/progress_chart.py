"""The chart of a racer's ranks in a season, as SVG without scripts."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import log10

from core.pages.charts import Chart

CHART = Chart("progress-chart", 430, 210, left=46, right=14, top=14, bottom=30)


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
    decades = int(log10(max(10, *(point.rank for point in points))) + 0.999)
    places = [((index + 0.5) / len(points), log10(point.rank) / decades) for index, point in enumerate(points)]
    parts = [CHART.begin(title), CHART.scale((power / decades, str(10**power)) for power in range(decades + 1))]
    for series in dict.fromkeys(point.series for point in points):
        own = [place for place, point in zip(places, points, strict=True) if point.series == series]
        parts.append(f'<path class="chart-line {escape(series)}" d="{CHART.line(own)}"/>')
    for (x, y), point in zip(places, points, strict=True):
        parts.append(
            f'<circle class="chart-point {escape(point.series)}" cx="{CHART.x(x):.1f}" cy="{CHART.y(y):.1f}" r="5">'
            f"<title>{escape(point.title)}</title></circle>"
        )
    parts.append(CHART.labels((x, point.label) for (x, _y), point in zip(places, points, strict=True)))
    return "".join((*parts, "</svg>"))
