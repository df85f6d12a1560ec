"""Which tracks a page or the API shows. Tracks are public."""

from __future__ import annotations

from django.db.models import Q, QuerySet

from paddock.geometry.catalogue import CATALOGUE

from .figures import figure, with_figures
from .models import Track


def all_tracks() -> QuerySet[Track]:
    """Every track without its geometry's bytes: the catalogue first, then by length."""
    return Track.objects.select_related("owner").defer("npy").order_by("-is_catalogue", "length_m", "pk")


def found_tracks(*, search: str = "", sort: str = "") -> QuerySet[Track]:
    """The tracks whose name, address, importer or name in the official simulator holds ``search``, with their figures,
    sorted by the figure that ``sort`` names (see :mod:`.figures`)."""
    tracks = with_figures(all_tracks())
    words = search.strip()
    if words:
        files = [entry.slug for entry in CATALOGUE if words.lower() in entry.file.lower()]
        tracks = tracks.filter(
            Q(name__icontains=words)
            | Q(slug__icontains=words)
            | Q(owner__alias__icontains=words)
            | Q(is_catalogue=True, slug__in=files)
        )
    return tracks.order_by(figure(sort).order, "name", "pk")
