"""Two laps as SVG charts over the way driven."""

from collections.abc import Sequence
from html import escape
from math import floor, log10

import numpy as np

from core.pages.charts import Chart
from races.replays.comparison import LapComparison

CHART = Chart("lap-chart", 640, 204, left=56, right=12, top=26, bottom=28)


def gap_chart(compared: LapComparison, *, title: str, ahead: str, behind: str) -> str:
    """The gap in seconds; ``ahead``, ``behind``: the labels of the halves above and below zero."""
    seconds = [gap / 1000 for gap in compared.gap_ms]
    most = max(0.05, *(abs(gap) for gap in seconds)) * 1.1
    zero, line = CHART.y(0.5), _line(compared, seconds, -most, most)
    area = f"M{CHART.left} {zero:.1f}L{line[1:]}V{zero:.1f}Z"
    text = f'<text class="gap-side" x="{CHART.left + 6}"'
    return "".join(
        (
            _axes(compared, title, -most, most, unit="s", signed=True),
            f'<clipPath id="gap-ahead"><path d="M0 0H{CHART.width}V{zero:.1f}H0Z"/></clipPath>',
            f'<clipPath id="gap-behind"><path d="M0 {zero:.1f}H{CHART.width}V{CHART.height}H0Z"/></clipPath>',
            f'<path class="gap-area ahead" clip-path="url(#gap-ahead)" d="{area}"/>',
            f'<path class="gap-area behind" clip-path="url(#gap-behind)" d="{area}"/>',
            f'<path class="gap-zero" d="M{CHART.left} {zero:.1f}H{CHART.width - CHART.right}"/>',
            f'<path class="gap-line" d="{line}"/>',
            f'{text} y="{CHART.top + 12}">{escape(ahead)}</text>',
            f'{text} y="{CHART.height - CHART.bottom - 6}">{escape(behind)}</text></svg>',
        )
    )


def speed_chart(compared: LapComparison, *, title: str) -> str:
    fastest = max(1.0, *compared.speed, *compared.other_speed) * 1.1
    one, other = (_line(compared, speeds, 0.0, fastest) for speeds in (compared.speed, compared.other_speed))
    axes = _axes(compared, title, 0.0, fastest, unit="m/s")
    return f'{axes}<path class="speed-line lap-1" d="{other}"/><path class="speed-line lap-0" d="{one}"/></svg>'


def _line(compared: LapComparison, values: Sequence[float], low: float, high: float) -> str:
    places = zip(compared.metres, values, strict=True)
    return CHART.line((metres / compared.length_m, (high - value) / (high - low)) for metres, value in places)


def _axes(compared: LapComparison, title: str, low: float, high: float, *, unit: str, signed: bool = False) -> str:
    """The drawing up to its grid: metres to the right, from ``low`` to ``high`` upwards."""
    step, step_m = _step((high - low) / 4), _step(compared.length_m / 8)
    values = step * np.arange(-(-low // step), high // step + 1) + 0.0  # no "-0"
    metres = np.arange(0.0, compared.length_m * 0.95, step_m)  # the unit stands at the end
    texts = [f"{value:+.3g}".replace("-", "−") if signed and value else f"{value:.3g}" for value in values]
    return "".join(
        (
            CHART.begin(title),
            CHART.scale(zip((high - values) / (high - low), texts, strict=True)),
            CHART.labels((each / compared.length_m, f"{each:g}") for each in metres),
            f'<text class="chart-unit" x="{CHART.left - 7}" y="12">{unit}</text>',
            f'<text class="chart-unit" x="{CHART.width - CHART.right}" y="{CHART.height - 9}">m</text>',
        )
    )


def _step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) that is at least ``least``."""
    power = 10.0 ** floor(log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least)
