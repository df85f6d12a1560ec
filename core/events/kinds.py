"""The registry of event kinds. Each room registers its kinds in its module ``events``."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EventKind:
    """A kind of event, named ``thing.what_happened``.

    ``summary``: for the documentation; ``names``: the filled columns of :data:`COLUMNS`;
    ``data``: the keys of its JSON; ``once``: what there is one event for, empty for any number."""

    name: str
    summary: str
    names: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    once: str = ""


KINDS: dict[str, EventKind] = {}
COLUMNS = ("racer", "race", "subject")


def register(kind: EventKind) -> EventKind:
    """Register a kind. Raises ValueError for another kind of the same name and for an unknown column."""
    if KINDS.get(kind.name, kind) != kind:
        raise ValueError(f"there are two kinds of event called {kind.name}")
    if unknown := set(kind.names) - set(COLUMNS):
        raise ValueError(f"{kind.name} names {', '.join(sorted(unknown))}, which is not a column of an event")
    KINDS[kind.name] = kind
    return kind
