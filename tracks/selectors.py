"""Which tracks a page or the API shows. Tracks are public."""

from __future__ import annotations

from django.db.models import QuerySet

from .models import Track


def all_tracks() -> QuerySet[Track]:
    """Every track without its geometry's bytes: the catalogue first, then by length."""
    return Track.objects.select_related("owner").defer("npy").order_by("-is_catalogue", "length_m", "pk")
