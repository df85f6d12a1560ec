"""What videos ask the room above, which knows the races: who may see a run, and what a video says of its race."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from django.db.models import QuerySet

from evaluation.models import Evaluation

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

    Viewer = Racer | AnonymousUser | None


@dataclass(frozen=True)
class Runs:
    """What is known of runs above this room.

    ``can_see``: whether somebody may see a run, and its twin ``visible_to``: all runs that they may see.
    ``titles``: of a run in a language, the title of its video and the line below. ``fastest_sectors_ms``: the times
    that its sectors are held against for purple, empty for a run that takes no marks. ``related``: what of a run to
    read with it. ``shown_together``: whether all these runs, by their ids, still stand as they were shown to
    everybody who may see the first.
    """

    can_see: Callable[[Viewer, Evaluation], bool]
    visible_to: Callable[[Viewer], QuerySet[Evaluation]]
    titles: Callable[[Evaluation, str], tuple[str, str]]
    fastest_sectors_ms: Callable[[Evaluation], Sequence[int | None]]
    related: tuple[str, ...] = ()
    shown_together: Callable[[Sequence[str]], bool] = lambda runs: False


_known: list[Runs] = []


def register_runs(runs: Runs) -> None:
    """Called once, when the site starts."""
    _known[:] = [runs]


def runs() -> Runs:
    """What was registered. Raises LookupError before."""
    if not _known:
        raise LookupError("no room has registered its runs with the videos")
    return _known[0]
