"""Reference laps for pages and rooms above."""

from collections.abc import Callable, Iterable

from core.streams.shared_pieces import shared_value
from paddock.simulator.engine import ENGINE_ID

from ..models import ReferenceLap, ReferenceState, Track

Pair = tuple[int, str]
Times = dict[tuple[int, str, str], int]  # ms by track id, direction and engine
Demand = Callable[[], Iterable[Pair]]
_demands: list[Demand] = []


def register_demand(demand: Demand) -> None:
    """Let reference laps be driven for the tracks, each ``(id, direction)``, that ``demand`` returns."""
    if demand not in _demands:
        _demands.append(demand)


def demanded() -> set[Pair]:
    """The tracks and directions that rooms above ask for."""
    return {pair for demand in _demands for pair in demand()}


def reference_lap(track: Track, direction: str, engine: str = ENGINE_ID) -> ReferenceLap | None:
    """The reference with its trace; None until it is driven. No query for one that is known to be missing."""
    if reference_ms(track.pk, direction, engine) is None:
        return None
    found = ReferenceLap.objects.filter(track=track, direction=direction, engine=engine)
    return found.filter(state=ReferenceState.FINISHED).first()


def reference_times() -> Times:
    """The best lap in ms of each reference by track id, direction and engine: one query, shared by all readers."""

    def read() -> Times:
        done = ReferenceLap.objects.filter(state=ReferenceState.FINISHED)
        rows = done.values_list("track_id", "direction", "engine", "time_ms").order_by()
        return {(track, direction, engine): ms for track, direction, engine, ms in rows if ms is not None}

    return shared_value("reference times", read)


def references_on(track: Track) -> list[ReferenceLap]:
    """The references of a track on this engine without their traces."""
    if not any(key[0] == track.pk and key[2] == ENGINE_ID for key in reference_times()):
        return []
    found = ReferenceLap.objects.filter(track=track, engine=ENGINE_ID, state=ReferenceState.FINISHED)
    return list(found.order_by("-direction").defer("trace"))


def reference_ms(track_id: int, direction: str, engine: str = ENGINE_ID, times: Times | None = None) -> int | None:
    """The best lap of one reference in ms; None until it is driven. ``times``: :func:`reference_times`, for many."""
    return (reference_times() if times is None else times).get((track_id, direction, engine))
