"""The registry of acts. Each is registered where its service is decorated."""

from dataclasses import dataclass

from django.utils.functional import Promise


@dataclass(frozen=True)
class AuditAct:
    """A kind of act, named ``thing.what_was_done``; ``label``: for pages."""

    name: str
    label: str | Promise


ACTS: dict[str, AuditAct] = {}


def register(act: AuditAct) -> AuditAct:
    """Register an act. Raises ValueError for another one of the same name."""
    known = ACTS.get(act.name)
    if known is not None and str(known.label) != str(act.label):
        raise ValueError(f"there are two acts called {act.name}")
    ACTS[act.name] = act
    return act
