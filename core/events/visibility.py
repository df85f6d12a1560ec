"""Visibility of events: a predicate and its queryset twin, from the audiences that rooms register."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from django.db.models import Q, QuerySet

from .kinds import KINDS
from .models import Event

OWN = "own"  # whom it concerns
# A racer, somebody who is not logged in, or None: the user model belongs to a room above.
Viewer = Any


@dataclass(frozen=True)
class Audience:
    """The viewers of some kinds: ``can_see(viewer, event)`` and its twin ``seen(viewer)``. Staff sees everything."""

    can_see: Callable[[Viewer, Event], bool]
    seen: Callable[[Viewer], Q]


AUDIENCES: dict[str, Audience] = {
    OWN: Audience(
        can_see=lambda viewer, event: _is_known(viewer) and event.racer_id == viewer.pk,
        seen=lambda viewer: Q(racer=viewer.pk) if _is_known(viewer) else Q(pk__in=[]),
    )
}


def register_audience(name: str, *, can_see: Callable[[Viewer, Event], bool], seen: Callable[[Viewer], Q]) -> None:
    """Say who belongs to an audience that kinds may name. Registering it again replaces it."""
    AUDIENCES[name] = Audience(can_see, seen)


def can_see_event(viewer: Viewer, event: Event) -> bool:
    """Whether the viewer may see an event; only staff sees unknown kinds. Twin of :func:`events_visible_to`."""
    if _is_known(viewer) and viewer.is_staff:
        return True
    kind = KINDS.get(event.kind)
    return kind is not None and AUDIENCES[kind.seen_by].can_see(viewer, event)


def events_visible_to(viewer: Viewer) -> QuerySet[Event]:
    """All events that the viewer may see, the earliest first. Twin of :func:`can_see_event`."""
    events = Event.objects.all()
    if _is_known(viewer) and viewer.is_staff:
        return events
    seen = Q(pk__in=[])
    for name, audience in AUDIENCES.items():
        kinds = [kind.name for kind in KINDS.values() if kind.seen_by == name]
        if kinds:
            seen |= Q(kind__in=kinds) & audience.seen(viewer)
    return events.filter(seen)


def _is_known(viewer: Viewer) -> bool:
    return viewer is not None and viewer.is_authenticated
