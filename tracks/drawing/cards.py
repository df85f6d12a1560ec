"""What links to tracks show elsewhere, and the map of a track for all cards."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from django.db.models import QuerySet
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from core.cards.registry import SURFACE, CardFigure, CardKind, CardShape, Points, ShareCard
from paddock.geometry.track import TrackGeometry

from ..models import Track
from ..selectors import figures, with_figures
from .maps import Trajectory, simplify, simplify_loop

_ROAD, _BORDER, _FINISH = "#39424f", "#aab2bd", "#ff3b55"
_SPEEDS = ("#e5484d", "#f2803a", "#f2c53d", "#9ccc3c", "#2fbf71", "#2cc9dd")
_ERROR_M = 0.03


def map_shapes(track: TrackGeometry, lines: Sequence[Trajectory] = ()) -> tuple[CardShape, ...]:
    """The map of a track with driven lines."""
    outlines = sorted(track.outlines, key=lambda line: -_reach(line))
    shapes = [
        CardShape(_points(simplify_loop(line, _ERROR_M)), SURFACE if number else _ROAD, _BORDER, 2)
        for number, line in enumerate(outlines)
    ]
    left, right = track.half_widths_at(track.finish_m)
    finish = (track.point_at(track.finish_m, left), track.point_at(track.finish_m, -right))
    shapes.append(CardShape(_points(finish), line=_FINISH, width=5, closed=False))
    for one in lines:
        for speed, points in one.strokes():
            colour = _SPEEDS[len(_SPEEDS) - 2 if speed is None else speed]
            shapes.append(CardShape(_points(simplify(points, _ERROR_M)), line=colour, width=4, closed=False))
    return tuple(shapes)


def map_of(track: Track) -> tuple[CardShape, ...]:
    """The map of a track in its file's direction; nothing where its shape is not known."""
    return map_shapes(track.geometry) if track.has_shape else ()


def _reach(line: Iterable[Sequence[float]]) -> float:
    across = [point[0] for point in line]
    return max(across) - min(across)


def _points(line: Iterable[Sequence[float]]) -> Points:
    return tuple((round(float(x), 2), round(float(y), 2)) for x, y, *_ in line)


def _card(key: str, hides: bool) -> ShareCard | None:
    track = with_figures(Track.objects.filter(slug=key)).first()
    if track is None:
        return None
    values = {figure.name: CardFigure(str(figure.label), figure.shown(track)) for figure in figures()}
    record, length = values.pop("record", None), values["length"]
    shown = [one for one in (record, length, values["corners"]) if one is not None and one.value]
    lines = (track.way(track.direction),) if track.has_shape else ()
    return ShareCard(_("Track"), track.name, lines, tuple(shown), picture=map_of(track))


def _public() -> QuerySet[Track]:
    return Track.objects.only("slug", "created_at").order_by("pk")


KINDS = (CardKind("track", gettext_lazy("Track"), "track", "slug", _card, _public, "created_at"),)
