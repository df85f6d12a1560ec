"""Figures of a track from its races: their number and the fastest lap."""

from collections.abc import Callable

from django.db.models import Count, OuterRef, Q, QuerySet, Subquery
from django.db.models.functions import Now
from django.utils.translation import pgettext_lazy

from core import times
from tracks.models import Track
from tracks.selectors import TrackFigure, register_figure

from ..models import Race, RaceType, Visibility
from ..models.rules import usual

REAL_CAR_RECORDS = 10
_SHOWN = {"visibility": Visibility.PUBLIC, "cancelled_at": None, "opens_at__lte": Now()}  # to everybody, and begun
_HELD = Q(**{f"races__{name}": value for name, value in _SHOWN.items()})


def standard_races() -> QuerySet[Race]:
    """Public simulated time trials whose laps compare: full off-track penalty, no speed control."""
    fair = Race.objects.filter(
        **_SHOWN,
        race_type=RaceType.TIME_TRIAL,
        physical=False,
        imported_at=None,
        off_track_penalty_ms__gte=usual("off_track_penalty_ms"),
    )
    return fair.exclude(live_event__speed_control=True)


def raced_ways() -> list[tuple[int, str]]:
    """The id and direction of each track that public simulated races are held on. Private ones do not count: guests see
    which tracks have a reference lap, and must not learn from it where others race."""
    held = Race.objects.filter(visibility=Visibility.PUBLIC, physical=False, imported_at=None, cancelled_at=None)
    return list(held.order_by().values_list("track_id", "direction").distinct())


def _record(*, reverse: bool) -> Subquery:
    """The fastest lap of a classified car in standard races of one direction: the file's, or the other."""
    raced = standard_races().filter(fastest_lap_ms__isnull=False)
    raced = raced.filter(Q(direction=OuterRef("direction"), _negated=reverse), track=OuterRef("pk"))
    return Subquery(raced.order_by("fastest_lap_ms").values("fastest_lap_ms")[:1])


def real_car_records(track: Track) -> QuerySet[Race]:
    """Races of real cars on a track with a classified racer, the latest first. Their times are never compared."""
    held = Race.objects.filter(**_SHOWN, track=track, physical=True, imported_at=None, fastest_lap_ms__isnull=False)
    return held.order_by("-opens_at", "-pk")[:REAL_CAR_RECORDS]


def _clock(column: str) -> Callable[[Track], str]:
    def shown(track: Track) -> str:
        record = getattr(track, column, None)
        return times.clock(record) if record else ""

    return shown


def register() -> None:
    records = (
        ("record", pgettext_lazy("of a track", "Record"), False),
        ("record_reverse", pgettext_lazy("of a track", "Record in reverse"), True),
    )
    for name, label, reverse in records:
        column = f"{name}_ms"
        register_figure(TrackFigure(name, label, column, _clock(column), annotation=_record(reverse=reverse)))
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
