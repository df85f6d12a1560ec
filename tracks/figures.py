"""What tracks are told apart and sorted by: their own measures, and what rooms above count on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from django.db.models import Expression, F, OrderBy, QuerySet, Subquery
from django.db.models.aggregates import Aggregate
from django.utils.functional import Promise
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, pgettext_lazy

from .models import Track


@dataclass(frozen=True)
class TrackFigure:
    """One figure of a track.

    ``name``: in addresses (``?sort=length``); ``column``: what is sorted by, and where there is an ``annotation`` the
    attribute that the list's rows carry; ``shown``: the figure for reading, ``""`` for none; ``falling``: the greatest
    comes first; ``leads``: the list is sorted by it unless somebody asks for another.
    """

    name: str
    label: str | Promise
    column: str
    shown: Callable[[Track], str]
    annotation: Expression | Aggregate | Subquery | None = None
    falling: bool = False
    leads: bool = False

    @property
    def order(self) -> OrderBy:
        """Tracks without the figure come last, whichever way it is sorted."""
        return F(self.column).desc(nulls_last=True) if self.falling else F(self.column).asc(nulls_last=True)


_FIGURES: dict[str, TrackFigure] = {}


def register_figure(figure: TrackFigure) -> None:
    """Show ``figure`` on the cards of tracks and let them be sorted by it."""
    _FIGURES[figure.name] = figure


def figures() -> tuple[TrackFigure, ...]:
    """All figures: the tracks' own first."""
    return tuple(_FIGURES.values())


def figure(name: str) -> TrackFigure:
    """The figure called ``name``, or the one that leads where there is none of that name."""
    return _FIGURES.get(name) or next((each for each in _FIGURES.values() if each.leads), _FIGURES["name"])


def with_figures(tracks: QuerySet[Track]) -> QuerySet[Track]:
    """``tracks`` with what rooms above count on each."""
    return tracks.annotate(**{each.column: each.annotation for each in figures() if each.annotation is not None})


def difficulty_words(track: Track) -> str:
    """A track's difficulty for reading: the word and the number; ``""`` where its shape is not known."""
    if track.difficulty is None:
        return ""
    if track.difficulty < 20:
        word = _("easy")
    elif track.difficulty < 35:
        word = _("medium")
    else:
        word = _("hard")
    return f"{word} · {track.difficulty}"


register_figure(TrackFigure("name", gettext_lazy("Name"), "name", lambda track: ""))
register_figure(
    TrackFigure(
        "length",
        gettext_lazy("Length"),
        "length_m",
        lambda track: f"{track.length_m:.2f} m" if track.length_m else _("length unknown"),
    )
)
register_figure(
    TrackFigure(
        "width", gettext_lazy("Width"), "width_m", lambda track: f"{track.width_m:.2f} m" if track.width_m else ""
    )
)
register_figure(
    TrackFigure(
        "corners",
        pgettext_lazy("of a track", "Corners"),
        "corners",
        lambda track: "" if track.corners is None else str(track.corners),
    )
)
register_figure(TrackFigure("difficulty", gettext_lazy("Difficulty"), "difficulty", difficulty_words))
