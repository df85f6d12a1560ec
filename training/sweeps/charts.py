"""The trials of a sweep as an SVG chart: how far the best evaluation came, over seconds of training."""

from collections.abc import Sequence
from html import escape
from itertools import accumulate

from django.utils.translation import gettext as _

from core.pages.charts import Chart

from .selectors import TrialRow, score_of

CHART = Chart("sweep-chart", 860, 300, left=56, right=14, top=14, bottom=30)
_PERCENTS = (0, 25, 50, 75, 100)


def progress_chart(rows: Sequence[TrialRow]) -> str:
    """Empty before the first evaluation. Above 100 % stand whole laps, the faster the higher."""
    drawn = [row for row in rows if row.points]
    if not drawn:
        return ""
    longest = max(row.points[-1][0] for row in drawn)
    highest = max(100.0, *(score_of(progress, lap) for row in drawn for _s, progress, lap in row.points)) * 1.02
    fastest = min((lap for row in drawn for _s, progress, lap in row.points if lap and progress >= 100.0), default=None)
    marks = [(1 - percent / highest, f"{percent} %") for percent in _PERCENTS]
    if fastest is not None:
        marks.append((1 - score_of(100.0, fastest) / highest, f"{fastest / 1000:.1f} s"))
    lines = []
    for row in sorted(drawn, key=lambda row: row.state == "best"):
        best = accumulate((score_of(progress, lap) for _s, progress, lap in row.points), max)
        places = [(point[0] / longest, 1 - value / highest) for point, value in zip(row.points, best, strict=True)]
        number = row.trial.number
        x, y = places[-1]
        lines.append(
            f'<g class="sweep-trial {row.state}"><title>{escape(_("Trial %(number)s") % {"number": number})}</title>'
            f'<path d="{CHART.line([(0.0, places[0][1]), *places])}"/>'
            f'<circle cx="{CHART.x(x):.1f}" cy="{CHART.y(y):.1f}" r="3"/></g>'
        )
    seconds = [(share, f"{longest * share:.0f} s") for share in (0.25, 0.5, 0.75)]
    title = _("Best progress of each trial over its seconds of training")
    return "".join((CHART.begin(title), CHART.scale(marks), *lines, CHART.labels(seconds), "</svg>"))
