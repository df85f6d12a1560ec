"""Two laps as SVG charts over the way driven, made on the server: no script, and the page's own colours."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from .comparing import LapComparison

WIDTH, HEIGHT = 640, 204
LEFT, RIGHT, TOP, BOTTOM = 56, 12, 26, 28
_STEPS = (1, 2, 5)


def gap_chart(compared: LapComparison, *, title: str, ahead: str, behind: str) -> str:
    """The gap in seconds, this lap ahead above the line and behind below it. ``title``: what it says, in words;
    ``ahead``, ``behind``: beside the two halves."""
    seconds = [gap / 1000 for gap in compared.gap_ms]
    most = max(0.05, *(abs(gap) for gap in seconds)) * 1.1
    frame = _Axes(compared.length_m, -most, most)
    line = frame.line(compared.metres, seconds)
    zero, last = frame.y(0.0), frame.x(compared.metres[-1])
    area = f"M{frame.x(0.0):.1f} {zero:.1f}L{line}L{last:.1f} {zero:.1f}Z"
    parts = [
        frame.begun(title, unit="s", signed=True),
        f'<clipPath id="gap-ahead"><path d="M0 0H{WIDTH}V{zero:.1f}H0Z"/></clipPath>',
        f'<clipPath id="gap-behind"><path d="M0 {zero:.1f}H{WIDTH}V{HEIGHT}H0Z"/></clipPath>',
        f'<path class="gap-area ahead" clip-path="url(#gap-ahead)" d="{area}"/>',
        f'<path class="gap-area behind" clip-path="url(#gap-behind)" d="{area}"/>',
        f'<path class="gap-zero" d="M{LEFT} {zero:.1f}H{WIDTH - RIGHT}"/>',
        f'<path class="gap-line" d="M{line}"/>',
        f'<text class="gap-side" x="{LEFT + 6}" y="{TOP + 12}">{escape(ahead)}</text>',
        f'<text class="gap-side" x="{LEFT + 6}" y="{HEIGHT - BOTTOM - 6}">{escape(behind)}</text>',
        "</svg>",
    ]
    return "".join(parts)


def speed_chart(compared: LapComparison, *, title: str) -> str:
    """The speeds of both laps, m/s."""
    fastest = max(1.0, *compared.speed, *compared.other_speed) * 1.1
    frame = _Axes(compared.length_m, 0.0, fastest)
    return "".join(
        (
            frame.begun(title, unit="m/s"),
            f'<path class="speed-line lap-1" d="M{frame.line(compared.metres, compared.other_speed)}"/>',
            f'<path class="speed-line lap-0" d="M{frame.line(compared.metres, compared.speed)}"/>',
            "</svg>",
        )
    )


class _Axes:
    """The axes: metres to the right, from ``low`` to ``high`` upwards."""

    def __init__(self, length_m: float, low: float, high: float) -> None:
        self._length_m, self._low, self._high = length_m, low, high

    def x(self, metres: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * metres / self._length_m

    def y(self, value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (self._high - value) / (self._high - self._low)

    def line(self, metres: Sequence[float], values: Sequence[float]) -> str:
        return "L".join(f"{self.x(at):.1f} {self.y(value):.1f}" for at, value in zip(metres, values, strict=True))

    def begun(self, title: str, *, unit: str, signed: bool = False) -> str:
        """The drawing up to its grid."""
        parts = [
            f'<svg class="lap-chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">',
        ]
        step = _step((self._high - self._low) / 4)
        mark = step * -(-self._low // step)
        while mark <= self._high + 1e-9:
            y = self.y(mark)
            said = f"{mark:+.3g}" if signed and abs(mark) > 1e-9 else f"{abs(mark):.3g}"
            parts.append(f'<path class="chart-grid" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
            parts.append(f'<text class="chart-scale" x="{LEFT - 7}" y="{y + 4:.1f}">{said.replace("-", "−")}</text>')
            mark += step
        step, mark = _step(self._length_m / 8), 0.0
        while mark <= self._length_m * 0.95:  # the unit stands at the end
            parts.append(f'<text class="chart-label" x="{self.x(mark):.1f}" y="{HEIGHT - 9}">{mark:g}</text>')
            mark += step
        parts.append(f'<text class="chart-unit" x="{LEFT - 7}" y="12">{unit}</text>')
        parts.append(f'<text class="chart-unit" x="{WIDTH - RIGHT}" y="{HEIGHT - 9}">m</text>')
        return "".join(parts)


def _step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) that is at least ``least``."""
    power = 1e-3
    while True:
        for factor in _STEPS:
            if factor * power >= least:
                return factor * power
        power *= 10
