"""Tracks on pages and in the API; all are public."""

from collections.abc import Callable
from dataclasses import dataclass

from django.core.validators import slug_re
from django.db.models import Expression, F, OrderBy, Q, QuerySet, Subquery
from django.db.models.aggregates import Aggregate
from django.utils.functional import Promise
from django.utils.translation import gettext, gettext_lazy, pgettext_lazy
from django.utils.translation import gettext as _

from core.streams.shared_pieces import shared_value
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.catalogue.names import closest, find, holding

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


def all_tracks() -> QuerySet[Track]:
    """Every track without its geometry's bytes: the catalogue first, then by length."""
    return Track.objects.select_related("owner").defer("npy").order_by("-is_catalogue", "length_m", "pk")


def shared_tracks() -> list[Track]:
    """The tracks that can be driven on, as forms offer them: read once a second for all readers."""
    return shared_value("tracks", lambda: list(Track.objects.exclude(length_m=None).defer("npy")))


def shared_track(slug: str) -> Track | None:
    """One of :func:`shared_tracks`."""
    return next((track for track in shared_tracks() if track.slug == slug), None)


def found_tracks(*, search: str = "", sort: str = "") -> QuerySet[Track]:
    """Tracks with figures whose name, address, importer or simulator name contains ``search``, sorted by figure
    ``sort``."""
    tracks = with_figures(all_tracks())
    words = search.strip()
    if words:
        known = [entry.slug for entry in holding(words)]
        tracks = tracks.filter(
            Q(name__icontains=words)
            | Q(slug__icontains=words)
            | Q(owner__alias__icontains=words)
            | Q(is_catalogue=True, slug__in=known)
        )
    return tracks.order_by(figure(sort).order, "name", "pk")


def track_named(name: str) -> Track | None:
    """The track of this address, or the catalogue's track of this name in the old console or the simulator's files."""
    name = name.strip()
    track = all_tracks().filter(slug=name).first() if slug_re.match(name) else None
    named = None if track else find(name)
    return all_tracks().filter(slug=named.track.slug).first() if named else track


def closest_tracks(name: str) -> list[tuple[Track, str]]:
    """The tracks of this site whose names are closest to an unknown one, each with that name."""
    here = {track.slug: track for track in all_tracks().exclude(length_m=None)}
    found = closest(name, here, [entry for entry in CATALOGUE if entry.slug in here])
    return [(here[slug], written) for slug, written in found.items()]


def nearest_names(name: str) -> str:
    """The names that :func:`closest_tracks` finds, with commas between."""
    return ", ".join(written for _track, written in closest_tracks(name))


def unknown_track(name: str) -> str:
    """A sentence for a name that no track has, with the closest names."""
    names = nearest_names(name)
    known = gettext("The closest names are: %(names)s.") % {"names": names} if names else ""
    shown = name[:64].encode("utf-8", "replace").decode()
    missing = gettext("There is no track %(name)s.") % {"name": shown}
    return f"{missing} {known}".strip()
