"""The progress graph of a training, drawn on the server as SVG: episode rewards, averages, progress, the best model."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Case, F, When
from django.template.loader import render_to_string

from ..models import TrainingIteration, TrainingJob

LEFT, RIGHT, TOP, BOTTOM = 52.0, 816.0, 14.0, 286.0  # of the plot in the picture of 860 x 320, as in the template
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


def points_of(job: TrainingJob, last: TrainingIteration | None) -> list[Point]:
    """The iterations of a training as points of the graph, with the episodes of at most :data:`MOST_CLOUDS`."""
    columns = ("number", "steps", "mean_reward", "mean_progress", "eval_progress", "eval_lap_ms", "is_best")
    every = math.ceil((0 if last is None else last.number) / MOST_CLOUDS) or 1
    drawn = Case(When(rest=0, then=F("episodes")))
    rows = job.iterations.annotate(rest=F("number") % every, drawn=drawn).order_by("number")
    return [
        Point(*[*row, tuple(float(episode["reward"]) for episode in episodes or ())])
        for *row, episodes in rows.values_list(*columns, "drawn")
    ]


def smoothed(values: Sequence[float | None], window: int) -> list[float | None]:
    """Each value's mean with the ones before it, ``window`` in all; None where there is none."""
    result: list[float | None] = []
    for index, value in enumerate(values):
        known = [each for each in values[max(0, index - window + 1) : index + 1] if each is not None]
        result.append(sum(known) / len(known) if value is not None and known else None)
    return result


def draw_graph(points: Sequence[Point], smoothing: int = 1) -> str:
    """The graph as SVG; what a cursor shows stands in its ``data-points``. Empty without a point."""
    if not points:
        return ""
    low, high, step = _scale(points)

    def x(index: float) -> float:
        return LEFT + (RIGHT - LEFT) * (index + 0.5) / len(points)

    def y(value: float) -> float:
        return TOP + (BOTTOM - TOP) * (1 - (value - low) / (high - low))

    def y_percent(value: float) -> float:
        return TOP + (BOTTOM - TOP) * (1 - value / 100)

    rewards = smoothed([point.reward for point in points], smoothing)
    progress = smoothed([point.progress for point in points], smoothing)
    evaluation = smoothed([point.evaluation for point in points], smoothing)
    keep = _kept(len(points))

    def along(values: Sequence[float | None], height: Callable[[float], float]) -> str:
        places = [(x(i), height(value)) for i in keep if (value := values[i]) is not None]
        if len(places) == 1:  # a line of one point is not visible
            places = [(places[0][0] + aside, places[0][1]) for aside in (-6, 6)]
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)

    grid = [low + number * step for number in range(round((high - low) / step) + 1)]
    every = math.ceil(len(points) / 10)
    best = next((index for index, point in enumerate(points) if point.is_best), None)
    context = {
        "cursor": json.dumps([_cursor_values(points[i], x(i), rewards[i], progress[i]) for i in keep]),
        "grid": [(f"{y(value):.1f}", f"{y(value) + 4:.1f}", f"{value:g}") for value in grid],
        "percents": [(f"{y_percent(percent) + 4:.1f}", percent) for percent in (0, 25, 50, 75, 100)],
        "numbers": [(f"{x(i):.1f}", str(points[i].number)) for i in range(0, len(points), every)],
        "dots": _dots(points, x, y),
        "lines": {
            "progress": along(progress, y_percent),
            "evaluation": along(evaluation, y_percent),
            "reward": along(rewards, y),
        },
        "best": None if best is None else (f"{x(best):.1f}", f"{y_percent(points[best].evaluation):.1f}"),
    }
    return render_to_string("training/jobs/parts/progress_graph.html", context)


def _cursor_values(point: Point, x: float, reward: float | None, progress: float | None) -> list[Any]:
    lap = None if point.lap_ms is None else point.lap_ms / 1000
    return [round(x, 1), point.number, point.steps, _short(reward), _short(progress), _short(point.evaluation), lap]


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def _kept(count: int) -> list[int]:
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


def _dots(points: Sequence[Point], x: Callable[[float], float], y: Callable[[float], float]) -> list[str]:
    """Paths of dots as strokes without a length, of which a thousand are one path."""
    places = [
        (index + (number + 0.5) / len(point.rewards) - 0.5, reward)
        for index, point in enumerate(points)
        for number, reward in enumerate(point.rewards)
    ]
    drawn = places[:: max(1, math.ceil(len(places) / MOST_DOTS))]
    return [
        "".join(f"M{x(place):.1f} {y(reward):.1f}h0" for place, reward in drawn[layer::LAYERS])
        for layer in range(min(LAYERS, len(drawn)))
    ]
