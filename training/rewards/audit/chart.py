"""The ranks of the eight drives by time and by reward as an SVG chart: level lines where both agree."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from operator import itemgetter

from core.pages.charts import Chart

LINE_PX = 26
CHART = Chart("audit-chart", 376, 42, left=148, right=148, top=34, bottom=8)  # without a drive


def rank_chart(rows: Sequence[tuple[str, int, int]], *, title: str, by_time: str, by_reward: str) -> str:
    """``rows``: name, rank by time and rank by reward of each drive, the best first; at least two. The texts are those
    of the chart for screen readers and of its columns."""
    chart = replace(CHART, height=CHART.height + LINE_PX * len(rows))
    places = [[row[0] for row in sorted(rows, key=itemgetter(rank))] for rank in (1, 2)]
    parts = [
        chart.begin(title),
        f'<text class="audit-head left" x="{chart.x(0) - 10}" y="20">{escape(by_time)}</text>',
        f'<text class="audit-head right" x="{chart.x(1) + 10}" y="20">{escape(by_reward)}</text>',
    ]
    for name, time, reward in rows:
        a, b = ((names.index(name) + 0.5) / len(rows) for names in places)
        style = "up" if reward < time else "down" if reward > time else "level"
        sides = ((0, a, f"{escape(name)} <tspan>{time}</tspan>"), (1, b, f"<tspan>{reward}</tspan> {escape(name)}"))
        parts.append(
            f'<g class="audit-drive {style}"><title>{escape(name)}: {time} → {reward}</title>'
            f'<path d="{chart.line([(0, a), (1, b)])}"/>'
            + "".join(
                f'<circle cx="{chart.x(side)}" cy="{chart.y(place):.1f}" r="4"/>'
                f'<text class="{("left", "right")[side]}" x="{chart.x(side) + (-10, 10)[side]}" '
                f'y="{chart.y(place) + 4.5:.1f}">{text}</text>'
                for side, place, text in sides
            )
            + "</g>"
        )
    return "".join((*parts, "</svg>"))
