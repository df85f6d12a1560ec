"""The graph of a training, as the console drew it: a point for each episode's reward, the averages as lines, progress
on the second axis, the best model marked. Drawn on the server, so that it needs no script to be seen."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import F
from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _

from .models import TrainingJob

WIDTH, HEIGHT = 860.0, 320.0
LEFT, RIGHT, TOP, BOTTOM = 52.0, 44.0, 14.0, 34.0
MOST_DOTS = 1500
MOST_POINTS = 600
MOST_CLOUDS = 150  # iterations whose episodes are drawn: a long training has a hundred thousand of them
LAYERS = 6  # of dots: those of one layer do not darken each other
SMOOTHINGS = (1, 3, 9)  # iterations that a smoothed value is the mean of


@dataclass(frozen=True)
class Point:
    """One iteration in the graph. ``rewards``: of its episodes, where they are drawn."""

    number: int
    steps: int
    reward: float | None
    progress: float | None
    evaluation: float
    lap_ms: int | None
    is_best: bool
    rewards: tuple[float, ...]


def points_of(job: TrainingJob) -> list[Point]:
    """The iterations of a training as points of the graph, with the episodes of at most :data:`MOST_CLOUDS`."""
    columns = ("number", "steps", "mean_reward", "mean_progress", "eval_progress", "eval_lap_ms", "is_best")
    rows = list(job.iterations.order_by("number").values_list(*columns))
    every = math.ceil(len(rows) / MOST_CLOUDS) or 1
    some = job.iterations.annotate(rest=F("number") % every).filter(rest=0)
    clouds = {
        number: tuple(float(episode["reward"]) for episode in episodes)
        for number, episodes in some.order_by("number").values_list("number", "episodes")
    }
    return [Point(*(*row, clouds.get(row[0], ()))) for row in rows]


def smoothed(values: Sequence[float | None], window: int) -> list[float | None]:
    """Each value's mean with the ones before it, ``window`` in all; None where there is none."""
    result: list[float | None] = []
    for index, value in enumerate(values):
        known = [each for each in values[max(0, index - window + 1) : index + 1] if each is not None]
        result.append(sum(known) / len(known) if value is not None and known else None)
    return result


def draw_graph(points: Sequence[Point], smoothing: int = 1) -> SafeString:
    """The graph as SVG; what a cursor shows stands in its ``data-points``. Empty without a point."""
    if not points:
        return SafeString("")
    low, high, step = _scale(points)
    count = len(points)

    def x(index: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (index + 0.5) / count

    def y(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1 - (value - low) / (high - low))

    def y_percent(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1 - value / 100)

    rewards = smoothed([point.reward for point in points], smoothing)
    progress = smoothed([point.progress for point in points], smoothing)
    evaluation = smoothed([point.evaluation for point in points], smoothing)
    keep = _kept(count)

    def along(values: Sequence[float | None], height: Callable[[float], float]) -> list[tuple[float, float]]:
        return [(x(i), height(value)) for i in keep if (value := values[i]) is not None]

    parts = [
        _axes(low, high, step, y, y_percent),
        _numbers(points, x),
        _dots(points, x, y),
        _line("graph-progress", along(progress, y_percent)),
        _line("graph-evaluation", along(evaluation, y_percent)),
        _line("graph-reward", along(rewards, y)),
    ]
    best = next((index for index, point in enumerate(points) if point.is_best), None)
    if best is not None:
        parts.append(
            format_html(
                '<g><title>{title}</title><line class="graph-best" x1="{x}" x2="{x}" y1="{top}" y2="{bottom}"/>'
                '<circle class="graph-best-mark" cx="{x}" cy="{y}" r="5"/></g>',
                title=_("Best model"),
                x=f"{x(best):.1f}",
                top=f"{TOP:.1f}",
                bottom=f"{HEIGHT - BOTTOM:.1f}",
                y=f"{y_percent(points[best].evaluation):.1f}",
            )
        )
    return format_html(
        '<svg class="graph" viewBox="0 0 {} {}" role="img" data-points="{}"><title>{}</title>{}</svg>',
        f"{WIDTH:g}",
        f"{HEIGHT:g}",
        json.dumps([_told(points[i], x(i), rewards[i], progress[i]) for i in keep]),
        _("Reward and progress of each iteration"),
        format_html_join("", "{}", ((part,) for part in parts)),
    )


def _told(point: Point, x: float, reward: float | None, progress: float | None) -> list[Any]:
    """What a cursor shows: x, number, steps, reward, progress, evaluation, lap, best."""
    lap = None if point.lap_ms is None else point.lap_ms / 1000
    return [round(x, 1), point.number, point.steps, _short(reward), _short(progress), _short(point.evaluation), lap]


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def _kept(count: int) -> list[int]:
    """Indices drawn: all, or as many as can be told apart, the last among them."""
    if count <= MOST_POINTS:
        return list(range(count))
    stride = count / MOST_POINTS
    return sorted({int(number * stride) for number in range(MOST_POINTS)} | {count - 1})


def _scale(points: Sequence[Point]) -> tuple[float, float, float]:
    """Least and greatest of the reward axis and the distance of its lines."""
    values = [value for point in points for value in point.rewards]
    values += [point.reward for point in points if point.reward is not None]
    low, high = min([0.0, *values]), max([1e-9, *values])
    rough = (high - low) / 4
    size = 10 ** math.floor(math.log10(rough))
    step = next(size * share for share in (1, 2, 2.5, 5, 10) if size * share >= rough)
    return math.floor(low / step) * step, math.ceil(high / step) * step, step


def _axes(low: float, high: float, step: float, y: Any, y_percent: Any) -> SafeString:
    lines, words = [], []
    for number in range(round((high - low) / step) + 1):
        value = low + number * step
        lines.append((f"{LEFT:g}", f"{WIDTH - RIGHT:g}", f"{y(value):.1f}"))
        words.append((f"{LEFT - 8:g}", f"{y(value) + 4:.1f}", "end", f"{value:g}"))
    words += [(f"{WIDTH - RIGHT + 8:g}", f"{y_percent(p) + 4:.1f}", "start", f"{p} %") for p in (0, 25, 50, 75, 100)]
    return format_html(
        "{}{}",
        format_html_join("", '<line class="graph-grid" x1="{0}" x2="{1}" y1="{2}" y2="{2}"/>', lines),
        format_html_join("", '<text x="{}" y="{}" text-anchor="{}">{}</text>', words),
    )


def _numbers(points: Sequence[Point], x: Any) -> SafeString:
    stride = max(1, math.ceil(len(points) / 10))
    words = [(f"{x(i):.1f}", f"{HEIGHT - 12:g}", point.number) for i, point in enumerate(points) if i % stride == 0]
    return format_html_join("", '<text x="{}" y="{}" text-anchor="middle">{}</text>', words)


def _dots(points: Sequence[Point], x: Any, y: Any) -> SafeString:
    """Dots as strokes without a length, of which a thousand are one path."""
    places = [
        (index + (number + 0.5) / len(point.rewards) - 0.5, reward)
        for index, point in enumerate(points)
        for number, reward in enumerate(point.rewards)
    ]
    drawn = places[:: max(1, math.ceil(len(places) / MOST_DOTS))]
    layers = (
        "".join(f"M{x(place):.1f} {y(reward):.1f}h0" for place, reward in drawn[layer::LAYERS])
        for layer in range(min(LAYERS, len(drawn)))
    )
    return mark_safe("".join(f'<path class="graph-dots" d="{layer}"/>' for layer in layers))


def _line(style: str, places: Sequence[tuple[float, float]]) -> SafeString:
    if len(places) == 1:  # a line of one point is not seen
        (x, y), *_rest = places
        places = [(x - 6, y), (x + 6, y)]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    return format_html('<polyline class="{}" points="{}"/>', style, points)
