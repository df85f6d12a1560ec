"""The one list of what can happen. Each room registers its kinds in its module ``events``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EventKind:
    """A kind of event.

    ``name``: what it is called in the table, ``thing.what_happened``. ``says``: one line for the documentation.
    ``seen_by``: the audience (:mod:`core.events.visibility`). ``names``: which of the columns ``racer``, ``race`` and
    ``subject`` it fills. ``data``: the names of all it keeps besides, small and JSON. ``once``: what there is one event
    for, in words; empty for a kind of which there may be any number.
    """

    name: str
    says: str
    seen_by: str
    names: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    once: str = ""


KINDS: dict[str, EventKind] = {}
COLUMNS = ("racer", "race", "subject")


def register(kind: EventKind) -> EventKind:
    """Add a kind to the list. Registering the same one twice changes nothing; raises ValueError for another one of the
    same name, and for a column that there is not."""
    if KINDS.get(kind.name, kind) != kind:
        raise ValueError(f"there are two kinds of event called {kind.name}")
    if unknown := set(kind.names) - set(COLUMNS):
        raise ValueError(f"{kind.name} names {', '.join(sorted(unknown))}, which is not a column of an event")
    KINDS[kind.name] = kind
    return kind
