"""What races say of the tracks that they are held on: how many there were, and the fastest lap."""

from __future__ import annotations

from collections.abc import Callable

from django.db.models import Count, OuterRef, Q, QuerySet, Subquery
from django.db.models.functions import Now
from django.utils.translation import pgettext_lazy

from core import times
from tracks.figures import TrackFigure, register_figure
from tracks.models import Track

from .models import Race, RaceType, Visibility
from .models.rules import usual

REAL_CAR_RECORDS = 10
_SHOWN = {"visibility": Visibility.PUBLIC, "cancelled_at": None, "opens_at__lte": Now()}  # to everybody, and begun
_HELD = Q(**{f"races__{name}": value for name, value in _SHOWN.items()})


def standard_races() -> QuerySet[Race]:
    """The races whose laps compare across races: simulated time trials of this site by standard rules, that is with
    no cheaper off-track penalty than the default and no speed control by racers."""
    fair = Race.objects.filter(
        **_SHOWN,
        race_type=RaceType.TIME_TRIAL,
        physical=False,
        imported_at=None,
        off_track_penalty_ms__gte=usual("off_track_penalty_ms"),
    )
    return fair.exclude(live_event__speed_control=True)


def _record(*, reverse: bool) -> Subquery:
    """The fastest lap of a classified car in standard races of one direction: the file's, or the other."""
    raced = standard_races().filter(fastest_lap_ms__isnull=False)
    raced = raced.filter(Q(direction=OuterRef("direction"), _negated=reverse), track=OuterRef("pk"))
    return Subquery(raced.order_by("fastest_lap_ms").values("fastest_lap_ms")[:1])


def real_car_records(track: Track) -> QuerySet[Race]:
    """The races of real cars on a track in which somebody is classified, each with its fastest lap, the latest first.

    They are listed by event and never compared: their times come from the organiser.
    """
    held = Race.objects.filter(**_SHOWN, track=track, physical=True, imported_at=None, fastest_lap_ms__isnull=False)
    return held.order_by("-opens_at", "-pk")[:REAL_CAR_RECORDS]


def _clock(column: str) -> Callable[[Track], str]:
    def shown(track: Track) -> str:
        record = getattr(track, column, None)
        return times.clock(record) if record else ""

    return shown


def register() -> None:
    """Show both on pages of tracks."""
    register_figure(
        TrackFigure(
            "record",
            pgettext_lazy("of a track", "Record"),
            "record_ms",
            _clock("record_ms"),
            annotation=_record(reverse=False),
        )
    )
    register_figure(
        TrackFigure(
            "record_reverse",
            pgettext_lazy("of a track", "Record in reverse"),
            "record_reverse_ms",
            _clock("record_reverse_ms"),
            annotation=_record(reverse=True),
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
