"""Which tracks a page or the API shows. Tracks are public."""

from __future__ import annotations

from django.core.validators import slug_re
from django.db.models import Q, QuerySet
from django.utils.translation import gettext

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.catalogue.names import closest, find, holding

from .figures import figure, with_figures
from .models import Track


def all_tracks() -> QuerySet[Track]:
    """Every track without its geometry's bytes: the catalogue first, then by length."""
    return Track.objects.select_related("owner").defer("npy").order_by("-is_catalogue", "length_m", "pk")


def found_tracks(*, search: str = "", sort: str = "") -> QuerySet[Track]:
    """The tracks whose name, address, importer or name in the official simulator contains ``search``.

    They have their figures and are sorted by the figure that ``sort`` names (see :mod:`.figures`)."""
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
