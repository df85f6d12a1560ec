"""Cards and embedded pages of runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from django.db.models import F, Q, QuerySet
from django.utils.translation import get_language, pgettext, pgettext_lazy
from django.utils.translation import gettext as _

from core.cards.registry import CardFigure, CardKind, CardShape, EmbeddedPart, Points, ShareCard
from core.times import clock
from evaluation.models import Evaluation, State
from evaluation.running.competitors import CompetitorRow, car_rows
from paddock.simulator.results import LapDocument
from races.entries.selectors.visibility import evaluations_visible_to
from races.models import Visibility
from races.replays.run_maps import ColourBy, trajectories
from races.replays.selectors import direction_of
from races.replays.setup import run_setup
from races.rules.layout import driven_boxes
from races.runs.video_titles import titles_of
from races.web.views import public_evaluation
from tracks.drawing.cards import map_shapes
from tracks.drawing.maps import Trajectory

_GREEN, _GLASS, _TYRE, _HUB = "#34d17f", "#9db7cf", "#2a313b", "#919ba8"


@dataclass(frozen=True)
class _SharedRun:
    """A run with what its card and its embedded page show. ``best``: the fastest complete lap of its driver."""

    run: Evaluation
    driver: CompetitorRow
    title: str
    lines: tuple[str, ...]
    best: LapDocument | None
    direction: str

    @classmethod
    def of(cls, key: str) -> _SharedRun | None:
        """None for a run that guests may not see, or that has no result."""
        run = public_evaluation(key)
        if run is None:
            return None
        cars = sorted(car_rows(run), key=lambda car: car.number)
        race, track = titles_of(run, get_language() or "en")
        first = f"{run.model.name} · {race}" if len(cars) == 1 else race
        complete = [lap for lap in cars[0].result.laps if lap["complete"]]
        best = min(complete, key=lambda lap: lap["time_ms"], default=None)
        title, lines = " – ".join(car.label for car in cars), tuple(filter(None, (first, track)))
        return cls(run, cars[0], title, lines, best, direction_of(run))

    @property
    def driven(self) -> list[Trajectory]:
        """The line of the best lap, else of the first."""
        number = self.best["number"] if self.best else 1
        return trajectories(self.driver.result.trajectory, ColourBy.SPEED, number)

    @property
    def figures(self) -> tuple[CardFigure, ...]:
        result, best = self.driver.result, self.best
        return (
            CardFigure(_("Best lap"), clock(best["time_ms"] if best else None), _GREEN if best else ""),
            CardFigure(_("Total"), clock(result.total_ms if result.laps else None)),
            CardFigure(_("Laps"), f"{result.complete_laps} / {len(result.laps)}"),
        )


def _card(key: str, hides: bool) -> ShareCard | None:
    shared = _SharedRun.of(key)
    if shared is None:
        return None
    note = _("Results are hidden until you watch the race.") if hides else ""
    geometry = shared.run.track.geometry.in_direction(shared.direction)
    picture = map_shapes(geometry, () if hides else shared.driven)
    look = car_shapes(*shared.driver.look)
    return ShareCard(
        pgettext("noun", "Run"), shared.title, shared.lines, () if hides else shared.figures, (), note, picture, look
    )


def car_shapes(shell: str, colour: str) -> tuple[CardShape, ...]:
    """A car from the side in its colour."""
    from videos.drawing.shapes import side  # loads a library for videos

    seen = side(shell)
    parts = ((seen.body, colour), (seen.glass, _GLASS), (seen.dark, _TYRE))
    shapes = [CardShape(_upright(outline), fill) for outlines, fill in parts for outline in outlines]
    for x, y, radius in seen.wheels:
        shapes += [CardShape(_ring(x, y, radius * share), fill) for share, fill in ((1.0, _TYRE), (0.45, _HUB))]
    return tuple(shapes)


def _upright(outline: Iterable[Sequence[float]]) -> Points:
    """An outline of a shell, whose y points down."""
    return tuple((round(float(x), 2), round(-float(y), 2)) for x, y in outline)


def _ring(x: float, y: float, radius: float) -> Points:
    angles = [2 * math.pi * number / 32 for number in range(32)]
    return _upright((x + radius * math.cos(angle), y + radius * math.sin(angle)) for angle in angles)


def _embedded(key: str, hides: bool) -> EmbeddedPart | None:
    shared = _SharedRun.of(key)
    if shared is None:
        return None
    context = {
        **{"evaluation": shared.run, "title": shared.title, "lines": shared.lines, "direction": shared.direction},
        **{"hides": hides, "driven": () if hides else shared.driven, "figures": shared.figures},
        # its document would be refused too
        "viewer": "" if hides else run_setup(shared.run, shared.best["number"] if shared.best else 0),
        "boxes": driven_boxes(shared.run.result.layout),
    }
    return EmbeddedPart("races/cards/run.html", context, 640)


def _public() -> QuerySet[Evaluation]:
    """The counted run of each entry in public races."""
    counted = Q(submission__entry__best=F("submission"), state=State.FINISHED)
    runs = evaluations_visible_to(None).filter(counted, submission__entry__race__visibility=Visibility.PUBLIC)
    return runs.select_related(None).only("public_id", "ended_at").order_by("pk")


KINDS = (
    CardKind(
        *("run", pgettext_lazy("noun", "Run"), "evaluation", "public_id", _card, _public, "ended_at"),
        results="evaluation",
        embedded=_embedded,
        also=("replay",),
    ),
)
