"""What races say of the tracks that they are held on: how many there were, and the fastest lap."""

from __future__ import annotations

from django.db.models import Count, Min, Q
from django.db.models.functions import Now
from django.utils.translation import pgettext_lazy

from core import times
from tracks.figures import TrackFigure, register_figure
from tracks.models import Track

from .models import Visibility

# Races that everybody sees and that have begun; of those with times from elsewhere the track's record is none
_HELD = Q(races__visibility=Visibility.PUBLIC, races__cancelled_at=None, races__opens_at__lte=Now())
_DRIVEN_HERE = _HELD & Q(races__imported_at=None)


def _record(track: Track) -> str:
    record = getattr(track, "record_ms", None)
    return times.clock(record) if record else ""


def register() -> None:
    """Show both on pages of tracks."""
    register_figure(
        TrackFigure(
            "record",
            pgettext_lazy("of a track", "Record"),
            "record_ms",
            _record,
            annotation=Min("races__fastest_lap_ms", filter=_DRIVEN_HERE),
        )
    )
    register_figure(
        TrackFigure(
            "raced",
            pgettext_lazy("of a track", "Races"),
            "raced",
            lambda track: str(getattr(track, "raced", "") or ""),
            annotation=Count("races", filter=_HELD),
            falling=True,
            leads=True,
        )
    )
