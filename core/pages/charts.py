"""The frame of the charts that the server draws as SVG: no script, and the page's own colours."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True)
class Chart:
    """A drawing with its margins in px. Places in it are shares of its inner width and height, from the upper left."""

    style: str
    width: int
    height: int
    left: int
    right: int
    top: int
    bottom: int

    def x(self, share: float) -> float:
        return self.left + (self.width - self.left - self.right) * share

    def y(self, share: float) -> float:
        return self.top + (self.height - self.top - self.bottom) * share

    def begin(self, title: str) -> str:
        box = f'class="{self.style}" viewBox="0 0 {self.width} {self.height}"'
        return f'<svg {box} role="img" aria-label="{escape(title)}">'

    def line(self, places: Iterable[tuple[float, float]]) -> str:
        """The data of a path through places."""
        return "M" + "L".join(f"{self.x(x):.1f} {self.y(y):.1f}" for x, y in places)

    def scale(self, marks: Iterable[tuple[float, str]]) -> str:
        """A line of the grid for each mark, with its text on the left."""
        return "".join(
            f'<path class="chart-grid" d="M{self.left} {self.y(share):.1f}H{self.width - self.right}"/>'
            f'<text class="chart-scale" x="{self.left - 7}" y="{self.y(share) + 4:.1f}">{text}</text>'
            for share, text in marks
        )

    def labels(self, marks: Iterable[tuple[float, str]]) -> str:
        """Texts below the chart."""
        return "".join(
            f'<text class="chart-label" x="{self.x(share):.1f}" y="{self.height - 9}">{escape(text)}</text>'
            for share, text in marks
        )


def sparkline(values: Sequence[float], title: str, *, width: int = 96, height: int = 22) -> str:
    """A small line of at least one value, lower values higher up, with a dot at the last of the best."""
    least, most = min(values), max(values)
    best = len(values) - 1 - list(reversed(values)).index(least)
    chart = Chart("spark", width, height, 4, 4, 4, 4)
    span, last = max(most - least, 1), max(len(values) - 1, 1)
    shares = [(number / last, (value - least) / span) for number, value in enumerate(values)]
    x, y = shares[best]
    dot = f'<circle class="spark-best" cx="{chart.x(x):.1f}" cy="{chart.y(y):.1f}" r="3"/>'
    return f'{chart.begin(title)}<path class="spark-line" d="{chart.line(shares)}"/>{dot}</svg>'
