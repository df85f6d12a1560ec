"""Which tracks a page or the API shows. Tracks are public."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import QuerySet

from .models import Track

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from league.models import Racer


def all_tracks() -> QuerySet[Track]:
    """Every track without its geometry's bytes: the catalogue first, then by length."""
    return Track.objects.select_related("owner").defer("npy").order_by("-is_catalogue", "length_m", "pk")


def tracks_of(racer: Racer | AnonymousUser) -> QuerySet[Track]:
    """What the racer imported, the newest first."""
    return Track.objects.filter(owner_id=racer.pk, owner__isnull=False).defer("npy").order_by("-created_at", "-pk")
